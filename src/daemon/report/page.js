"use strict";
const { up, page: perPage } = document.body.dataset;

// A small picture that a power cut has taken: the large one in its place.
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

// The names of all photos come when they are first asked for, as a script: a page opened from a disk may not read data.
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

// Where the photo of that number is: on this page, or on the page that holds its sixty.
const addressOf = (number, prefix) => {
  if (document.getElementById("photo-" + number)) return `#${prefix}-${number}`;
  return `${up}gallery/photos-${Math.floor(number / perPage) + 1}.html#${prefix}-${number}`;
};

const form = document.getElementById("find");
if (form) {
  const input = form.querySelector("input"), found = document.getElementById("found");
  const shownMax = 300;
  let state = "";
  const clear = () => { input.value = ""; choose(""); };
  const search = () => {
    const wanted = input.value.trim().toLowerCase();
    const active = wanted !== "" || state !== "";
    found.hidden = !active;
    for (const other of document.querySelectorAll("main > :not(#found)")) other.hidden = active;
    if (!active) return found.replaceChildren();
    const hits = [];
    names.forEach(([name, is], number) => { if (name.toLowerCase().includes(wanted) && (!state || is === state)) hits.push(number); });
    const count = document.createElement("p");
    count.setAttribute("role", "status");
    count.textContent = `${hits.length} of ${names.length} photos` + (hits.length > shownMax ? `, the newest ${shownMax} are shown` : "");
    const stamps = document.createElement("div");
    stamps.className = "stamps";
    for (const number of hits.reverse().slice(0, shownMax)) {
      const [name, , small] = names[number];
      const link = document.createElement("a"), picture = document.createElement("img");
      link.href = addressOf(number, "photo");
      link.addEventListener("click", clear);
      picture.src = up + small;
      picture.alt = "";
      picture.loading = "lazy";
      link.append(picture, name);
      stamps.append(link);
    }
    found.replaceChildren(count, stamps);
  };
  const choose = (which) => {
    state = which;
    for (const button of form.querySelectorAll("button")) button.setAttribute("aria-pressed", String(button.dataset.state === which));
    withNames(search);
  };
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("click", (event) => { if (event.target.dataset.state !== undefined) choose(event.target.dataset.state); });
  input.addEventListener("input", () => withNames(search));
}
