"use strict";
// A small picture that a power cut has taken: the large one in its place.
for (const small of document.querySelectorAll("img[data-large]")) {
  const large = () => { if (small.dataset.large) small.src = small.dataset.large; delete small.dataset.large; };
  small.addEventListener("error", large, { once: true });
  if (small.complete && small.naturalWidth === 0 && small.currentSrc) large();
}
for (const input of document.querySelectorAll(".pair input")) {
  const move = () => input.parentElement.style.setProperty("--at", input.value + "%");
  input.addEventListener("input", move);
  input.addEventListener("dblclick", () => { input.value = 50; move(); });
  move();
}
for (const button of document.querySelectorAll(".wide")) {
  button.addEventListener("click", () => {
    const card = button.closest("article");
    card.classList.toggle("large");
    card.scrollIntoView({ block: "nearest" });
  });
}
for (const time of document.querySelectorAll("time[data-unix]")) {
  const seconds = Number(time.dataset.unix);
  if (seconds > 0) time.textContent = new Date(seconds * 1000).toLocaleString();
}
const find = document.getElementById("find");
if (find) {
  find.addEventListener("input", () => {
    const wanted = find.value.toLowerCase();
    for (const card of document.querySelectorAll("article")) card.hidden = !card.dataset.name.includes(wanted);
  });
}
for (const hour of document.querySelectorAll("[data-hour]")) {
  hour.textContent = new Date(Number(hour.dataset.hour) * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
}
