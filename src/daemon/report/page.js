"use strict";
const { up, page: perPage } = document.body.dataset;

// A thumbnail damaged by a power cut is replaced by the preview.
for (const small of document.querySelectorAll("img[data-large]")) {
  const large = () => { if (small.dataset.large) small.src = small.dataset.large; delete small.dataset.large; };
  small.addEventListener("error", large, { once: true });
  if (small.complete && small.naturalWidth === 0 && small.currentSrc) large();
}

const speak = (input) => input.setAttribute("aria-valuetext", `${input.value} % of the photo, ${100 - input.value} % of the result`);
for (const input of document.querySelectorAll(".pair input")) {
  const move = () => { input.parentElement.style.setProperty("--at", input.value + "%"); speak(input); };
  input.addEventListener("input", move);
  move();
}

for (const time of document.querySelectorAll("time[data-unix]")) {
  time.textContent = new Date(Number(time.dataset.unix) * 1000).toLocaleString();
}
for (const hour of document.querySelectorAll("[data-hour]")) {
  hour.textContent = new Date(Number(hour.dataset.hour) * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
}

// The names of all photos are loaded on demand, as a script: a page opened from a disk may not read data files.
let names;
const asked = [];
const withNames = (then) => {
  if (names) return then();
  if (asked.push(then) > 1) return;
  window.relensNames = (rows) => { names = rows; asked.forEach((then) => then()); };
  const script = document.createElement("script");
  script.src = up + "gallery/names.js";
  document.head.append(script);
};

// Address of the photo with that number, on this or another page.
const addressOf = (number, prefix) => {
  if (document.getElementById("photo-" + number)) return `#${prefix}-${number}`;
  return `${up}gallery/photos-${Math.floor(number / perPage) + 1}.html#${prefix}-${number}`;
};

// The status line has the height that it reports.
const now = document.querySelector("iframe.now");
addEventListener("message", (event) => {
  if (now && event.source === now.contentWindow && event.data?.relensNow > 0) now.style.height = event.data.relensNow + 8 + "px";
});

const form = document.getElementById("find");
if (form) {
  const input = form.querySelector("input"), found = document.getElementById("found");
  const oneMore = 300;
  let state = "", shownMax = oneMore;
  // Photos without a result are listed on this page only.
  const among = (list, wanted, active) => {
    let shown = 0;
    for (const item of list.querySelectorAll("li")) {
      item.hidden = !item.firstElementChild.textContent.toLowerCase().includes(wanted);
      shown += !item.hidden;
    }
    list.hidden = active && (state !== "" || shown === 0);
    if (active && !list.hidden) list.open = true;
  };
  const search = () => {
    const wanted = input.value.trim().toLowerCase();
    const active = wanted !== "" || state !== "";
    history.replaceState(active ? { wanted: input.value, state, shownMax } : null, "");
    found.hidden = !active;
    for (const other of document.querySelectorAll("main > :not(#found)")) {
      if (other.matches(".failed, .waiting")) among(other, wanted, active);
      else other.hidden = active;
    }
    if (!active) return found.replaceChildren();
    const hits = [];
    names.forEach(([name, is], number) => { if (name.toLowerCase().includes(wanted) && (!state || is === state)) hits.push(number); });
    const count = document.createElement("p");
    count.setAttribute("role", "status");
    count.textContent = `${hits.length} of ${names.length} photos with a result` + (hits.length > shownMax ? `, the newest ${shownMax} are shown` : "");
    const stamps = document.createElement("div");
    stamps.className = "stamps";
    for (const number of hits.reverse().slice(0, shownMax)) {
      const [name, , small] = names[number];
      const link = document.createElement("a"), picture = document.createElement("img");
      link.href = addressOf(number, "photo");
      // A hit on this page closes the search; the browser's Back reopens it.
      if (link.hash && link.getAttribute("href").startsWith("#")) link.addEventListener("click", leave);
      picture.src = up + small;
      picture.alt = "";
      picture.loading = "lazy";
      link.append(picture, name);
      stamps.append(link);
    }
    found.replaceChildren(count, stamps);
    if (hits.length <= shownMax) return;
    const more = document.createElement("button");
    more.type = "button";
    more.textContent = `${Math.min(oneMore, hits.length - shownMax)} more`;
    more.addEventListener("click", () => { shownMax += oneMore; search(); });
    found.append(more);
  };
  const press = (which) => {
    state = which;
    for (const button of form.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.state === which));
  };
  const again = (kept) => {
    press(kept?.state ?? "");
    input.value = kept?.wanted ?? "";
    shownMax = kept?.shownMax ?? oneMore;
    withNames(search);
  };
  const leave = (event) => {
    event.preventDefault();
    history.pushState(null, "", event.currentTarget.getAttribute("href"));
    again(null);
    document.querySelector(location.hash)?.scrollIntoView();
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("click", (event) => {
    if (event.target.dataset.state === undefined) return;
    press(event.target.dataset.state);
    shownMax = oneMore;
    withNames(search);
  });
  input.addEventListener("input", () => { shownMax = oneMore; withNames(search); });
  addEventListener("popstate", (event) => { if (event.state || !found.hidden) again(event.state); });
  if (history.state?.shownMax) again(history.state);
}
