"use strict";
for (const time of document.querySelectorAll("time[data-unix]")) {
  time.textContent = new Date(Number(time.dataset.unix) * 1000).toLocaleString();
}
// Reports the height to the surrounding page.
const tell = () => parent.postMessage({ relensNow: document.body.offsetHeight }, "*");
addEventListener("resize", tell);
tell();
setTimeout(() => location.replace(location.href), 3000);
