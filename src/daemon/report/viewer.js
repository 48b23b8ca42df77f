// Full-screen viewer: synchronised zoom of photo and result, keys and swipes from photo to photo.
{
  const make = (tag, parent, content = {}) => { const made = Object.assign(document.createElement(tag), content); parent.append(made); return made; };
  const viewer = make("dialog", document.body, { id: "viewer" });
  const stage = make("div", viewer, { className: "stage", tabIndex: 0 });
  stage.setAttribute("role", "group");
  stage.setAttribute("aria-label", "Photo and result, one over the other");
  const result = make("img", make("div", stage));
  const over = make("div", stage);
  const photo = make("img", over);
  const line = make("i", stage);
  make("span", stage, { textContent: "photo" });
  const tag = make("span", stage);
  const tools = make("div", viewer, { className: "tools" });
  const title = make("p", tools);
  const button = (text, label, act) => { make("button", tools, { type: "button", textContent: text, ariaLabel: label }).addEventListener("click", act); };
  button("←", "Newer photo", () => go(-1));
  button("→", "Older photo", () => go(1));
  const slider = make("input", tools, { type: "range", min: 0, max: 100, value: 50, ariaLabel: "How much of the photo lies over the result" });
  button("−", "Smaller", () => step(-1));
  const fitOrPixels = make("button", tools, { type: "button", title: "The whole photo, or its pixels" });
  button("+", "Larger", () => step(1));
  const truth = make("button", tools, { type: "button", textContent: "Scene" });
  const links = make("span", tools);
  button("Close", "Close", () => viewer.close());

  const cards = [...document.querySelectorAll("article")];
  let at = 0, scale = 1, x = 0, y = 0; // Index of the card; screen pixels per picture pixel; the picture's point in the middle of the stage.
  let isFit = true; // Whether the whole picture is shown, also after the stage is resized.
  // Size of the result, whichever picture of it is loaded.
  const size = () => { const after = cards[at]?.querySelector(".after img"); return ["width", "height"].map((side) => Number(after?.getAttribute(side)) || 1); };
  const fit = () => { const [w, h] = size(); return Math.min(stage.clientWidth / w, stage.clientHeight / h); };
  const pixel = () => 1 / window.devicePixelRatio;
  const draw = () => {
    const [w, h] = size();
    scale = isFit ? fit() : Math.min(Math.max(scale, fit()), Math.max(16 * pixel(), fit()));
    const [halfX, halfY] = [stage.clientWidth / 2 / scale, stage.clientHeight / 2 / scale];
    const within = (value, half, whole) => whole <= 2 * half ? whole / 2 : Math.min(Math.max(value, half), whole - half);
    x = within(x, halfX, w);
    y = within(y, halfY, h);
    for (const picture of [photo, result]) {
      picture.style.width = w + "px";
      picture.style.height = h + "px";
      picture.style.transform = `translate(${(halfX - x) * scale}px, ${(halfY - y) * scale}px) scale(${scale})`;
    }
    over.style.clipPath = `inset(0 ${100 - slider.value}% 0 0)`;
    line.style.left = slider.value + "%";
    speak(slider);
    stage.classList.toggle("pixels", scale >= 1.9 * pixel());
    const percent = Math.round(100 * scale / pixel());
    fitOrPixels.textContent = percent + " %";
    fitOrPixels.ariaLabel = `${percent} %: ` + (isFit ? "show its pixels" : "show the whole photo");
  };
  // Keeps the point under (px, py) of the stage fixed.
  const zoom = (to, px = stage.clientWidth / 2, py = stage.clientHeight / 2) => {
    to = Math.min(Math.max(to, fit()), Math.max(16 * pixel(), fit()));
    const [dx, dy] = [px - stage.clientWidth / 2, py - stage.clientHeight / 2];
    x += dx / scale - dx / to;
    y += dy / scale - dy / to;
    scale = to;
    isFit = to <= fit() * 1.001;
    draw();
  };
  // The next scale that is a power of two of the screen's pixels.
  const next = (by) => pixel() * 2 ** (by > 0 ? Math.floor(Math.log2(scale / pixel()) + 1.01) : Math.ceil(Math.log2(scale / pixel()) - 1.01));
  const step = (by) => zoom(next(by));
  const fitOr = (px, py) => isFit ? zoom(Math.max(pixel(), next(1)), px, py) : zoom(0);
  fitOrPixels.addEventListener("click", () => fitOr());
  // Moves the view by (dx, dy) quarters of its size.
  const pan = (dx, dy) => {
    x += dx * stage.clientWidth / scale / 4;
    y += dy * stage.clientHeight / scale / 4;
    draw();
  };
  // Shows a picture of the card, then its full-size version once loaded.
  const put = (into, picture) => {
    [into.src, into.alt] = [picture.src, picture.alt];
    const { pixels } = picture.dataset;
    into.dataset.wanted = pixels || "";
    if (!pixels) return;
    const large = new Image();
    large.onload = () => { if (into.dataset.wanted === pixels) into.src = large.src; };
    large.src = pixels;
  };
  // The picture under the photo: the result or the true scene.
  let scene;
  const underneath = (picture) => {
    put(result, picture);
    tag.textContent = picture.parentElement.textContent;
    truth.setAttribute("aria-pressed", String(picture === scene));
  };
  truth.addEventListener("click", () => underneath(truth.ariaPressed === "true" ? cards[at].querySelector(".after img") : scene));
  const show = (index) => {
    at = index;
    const card = cards[at], [before, after] = card.querySelectorAll(".pair img");
    put(photo, before);
    scene = card.querySelector(".scene img");
    truth.hidden = !scene;
    underneath(after);
    const name = card.querySelector("h2").textContent;
    viewer.setAttribute("aria-label", name);
    title.textContent = `${name}: ${card.querySelector(".state").textContent}`;
    links.replaceChildren(...[...card.querySelectorAll(".links a")].map((link) => link.cloneNode(true)));
    if (!viewer.open) viewer.showModal();
    stage.focus();
    isFit = true;
    draw();
    for (const near of [at - 1, at + 1]) if (cards[near]) for (const img of cards[near].querySelectorAll(".pair img")) new Image().src = img.src;
  };
  result.addEventListener("load", draw);
  // Past the last photo of this page, continue on the neighbouring page.
  const go = (step) => {
    if (cards[at + step]) return show(at + step);
    const number = Number(cards[at].dataset.number) - step;
    const more = step > 0 ? document.querySelector("nav") : document.querySelector("nav [rel=prev]");
    if (number >= 0 && more) location.href = addressOf(number, "view");
  };
  viewer.addEventListener("close", () => cards[at].querySelector(".pair input").focus());
  slider.addEventListener("input", draw);
  slider.addEventListener("pointerup", () => stage.focus());
  window.addEventListener("resize", draw);
  viewer.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const across = (by) => event.shiftKey ? pan(by, 0) : go(by);
    const act = { ArrowLeft: () => across(-1), ArrowRight: () => across(1), "+": () => step(1), "-": () => step(-1), "0": () => zoom(0), "1": () => zoom(isFit ? Math.max(pixel(), next(1)) : pixel()), ArrowUp: () => pan(0, -1), ArrowDown: () => pan(0, 1) }[event.key];
    if (!act || (event.target === slider && event.key.startsWith("Arrow"))) return;
    event.preventDefault();
    act();
  });
  stage.addEventListener("wheel", (event) => { event.preventDefault(); zoom(scale * 2 ** (-event.deltaY / 300), event.offsetX, event.offsetY); }, { passive: false });
  stage.addEventListener("dblclick", (event) => fitOr(event.offsetX, event.offsetY));

  // One finger moves the line or the picture or swipes to the next photo; two zoom.
  const fingers = new Map();
  let began, onLine;
  stage.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, event);
    stage.setPointerCapture(event.pointerId);
    began = event;
    onLine = event.target === line;
  });
  stage.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
    if (fingers.size === 2) {
      const before = apart();
      fingers.set(event.pointerId, event);
      const [a, b] = [...fingers.values()], box = stage.getBoundingClientRect();
      zoom(scale * apart() / Math.max(before, 1), (a.clientX + b.clientX) / 2 - box.left, (a.clientY + b.clientY) / 2 - box.top);
      began = undefined;
      return;
    }
    fingers.set(event.pointerId, event);
    if (onLine) {
      slider.value = 100 * (event.clientX - stage.getBoundingClientRect().left) / stage.clientWidth;
    } else if (!isFit) {
      x -= (event.clientX - last.clientX) / scale;
      y -= (event.clientY - last.clientY) / scale;
    }
    draw();
  });
  const lift = (event) => {
    fingers.delete(event.pointerId);
    const [dx, dy] = began ? [event.clientX - began.clientX, event.clientY - began.clientY] : [0, 0];
    if (event.type === "pointerup" && !onLine && isFit && Math.abs(dx) > 60 && Math.abs(dx) > 2 * Math.abs(dy)) go(dx < 0 ? 1 : -1);
    began = undefined;
  };
  stage.addEventListener("pointerup", lift);
  stage.addEventListener("pointercancel", lift);

  cards.forEach((card, index) => {
    const open = make("button", card.querySelector(".links"), { type: "button", textContent: "Full screen" });
    open.setAttribute("aria-label", "Full screen: " + card.querySelector("h2").textContent);
    open.addEventListener("click", () => show(index));
    card.querySelector(".pair").addEventListener("dblclick", () => show(index));
    if (!card.querySelector(".scene")) return;
    const toggle = make("button", card.querySelector(".links"), { type: "button", textContent: "True scene", ariaPressed: "false" });
    toggle.addEventListener("click", () => { toggle.ariaPressed = String(card.querySelector(".pair").classList.toggle("truth")); });
  });
  const fromAddress = () => {
    const index = cards.findIndex((card) => location.hash === "#view-" + card.dataset.number);
    if (index >= 0) show(index);
  };
  window.addEventListener("hashchange", fromAddress);
  fromAddress();
}
