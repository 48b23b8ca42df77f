// Checks every page written by `tests/gallery/run` and reports the faults.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const out = process.argv[2];
const require = createRequire(`${out}/node_modules/`);
const { chromium } = require("playwright-core");
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

const WIDTHS = [[390, 844], [1300, 1000], [2560, 1440]];
const RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
const PAGES = [1, 4, 60, 4000].map((count) => [`${count}`, `${count}/outbox/index.html`]);
PAGES.push(["4000-page-30", "4000/outbox/gallery/photos-30.html"]);
// A frame of the first page; axe does not enter frames of local files.
PAGES.push(["now", "4/outbox/gallery/now.html"]);

const wrong = [];
let looks = 0;
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-gpu"] });
for (const [name, path] of PAGES) {
  for (const [width, height] of WIDTHS) {
    for (const colorScheme of ["light", "dark"]) {
      const context = await browser.newContext({ viewport: { width, height }, colorScheme });
      const page = await context.newPage();
      const say = (what) => wrong.push(`${name}, ${width} px, ${colorScheme}: ${what}`);
      page.on("pageerror", (error) => say(`a script failed: ${error}`));
      await page.goto(`file://${out}/pages/${path}`);
      await page.evaluate(axe);
      const look = async (what) => {
        looks += 1;
        await page.screenshot({ path: `${out}/${name}-${what}-${width}-${colorScheme}.png` });
        const found = await page.evaluate(async (rules) => {
          const seen = (e) => e.offsetParent && !e.closest(".pair");
          const small = [...document.querySelectorAll("a, button, summary, input")].filter(seen).filter((e) => {
            const { width, height } = e.getBoundingClientRect();
            return width > 0 && (width < 43.5 || height < 43.5);
          });
          const { violations } = await window.axe.run(document, { runOnly: rules });
          return {
            axe: violations.map((v) => `axe, ${v.id}: ${v.nodes.length} of ${v.nodes[0].html.slice(0, 120)}`),
            small: small.map((e) => `smaller than 44 px: ${e.outerHTML.slice(0, 120)}`),
            wide: document.documentElement.scrollWidth - innerWidth,
          };
        }, RULES);
        found.axe.concat(found.small.slice(0, 5)).forEach((words) => say(`${what}: ${words}`));
        if (found.wide > 0) say(`${what}: ${found.wide} px wider than the screen`);
      };
      await look("page");
      if (name === "now") {
        await context.close();
        continue;
      }
      const [, line] = page.frames();
      if (line) {
        await page.waitForTimeout(200);
        const needed = await line.evaluate(() => document.body.offsetHeight);
        const { height } = await page.locator("iframe.now").boundingBox();
        if (needed > height) say(`the line of what the box is doing needs ${needed} px and has ${height}`);
      }
      await page.evaluate(() => document.querySelectorAll("details").forEach((e) => { e.open = true; }));
      await look("open");
      await page.locator("article button").first().click();
      await look("viewer");
      // Photo and result in step, whole at first, then by pixels; keys lead on.
      const seen = () => page.evaluate(() => {
        const box = (e) => { const { x, y, width, height } = e.getBoundingClientRect(); return [x, y, width, height].map(Math.round); };
        const [under, over] = [...document.querySelectorAll("#viewer .stage img")].map(box);
        return { under, over, stage: box(document.querySelector("#viewer .stage")), title: document.querySelector("#viewer .tools p").textContent };
      });
      const apart = ({ under, over }) => under.join() !== over.join();
      const whole = await seen();
      if (apart(whole)) say("the pictures are not in step");
      if (whole.under[2] > whole.stage[2] + 1 || whole.under[3] > whole.stage[3] + 1) say(`the whole photo is cut: ${whole.under} in ${whole.stage}`);
      for (const key of ["1", "+", "+"]) await page.keyboard.press(key);
      const near = await seen();
      if (apart(near) || near.under[2] <= whole.under[2]) say("zoomed, the pictures are not in step");
      await page.keyboard.press("ArrowRight");
      if (name !== "1" && (await seen()).title === whole.title) say("an arrow key leads nowhere");
      await page.keyboard.press("Escape");
      if (await page.locator("#find").count()) {
        await page.fill("#find input", "00");
        await page.locator("#found p").waitFor();
        await look("search");
        if (await page.locator(".failed").count()) {
          await page.fill("#find input", "cut");
          await page.locator(".failed li", { hasText: "cut.jpg" }).waitFor({ timeout: 5000 }).catch(() => say("a failed photo is not found"));
          if (await page.locator(".failed li", { hasText: "empty.jpg" }).isVisible()) say("a failed photo of another name is found");
        }
        await page.fill("#find input", "");
        await page.locator("#find button[data-state=unchanged]").click();
        const shown = () => page.locator("#found .stamps a").count();
        const first = await shown(), more = page.locator("#found button");
        if (await more.count()) await more.click();
        if (name === "4000" && (await shown()) <= first) say("no more hits come");
        const kept = await shown();
        await page.locator("#found .stamps a").last().click();
        await page.waitForTimeout(100);
        if (await page.locator("#found").isVisible()) say("a hit leads nowhere");
        await page.goBack();
        await page.locator("#found .stamps a").first().waitFor({ timeout: 5000 }).catch(() => {});
        if ((await shown()) !== kept) say(`back from a hit, ${await shown()} of ${kept} are found`);
      }
      await context.close();
    }
  }
  if (name === "now") continue;
  // Without scripts both pictures are there, side by side or one below the other.
  for (const [width, height] of WIDTHS) {
    const context = await browser.newContext({ viewport: { width, height }, javaScriptEnabled: false });
    const page = await context.newPage();
    await page.goto(`file://${out}/pages/${path}`);
    looks += 1;
    await page.screenshot({ path: `${out}/${name}-no-script-${width}.png` });
    const boxes = await Promise.all(["before", "after"].map((kind) => page.locator(`article .${kind} img`).first().boundingBox()));
    const [before, after] = boxes.map((box) => box ?? { x: 0, y: 0, width: 0, height: 0 });
    const clear = before.x + before.width <= after.x + 1 || before.y + before.height <= after.y + 1;
    if (before.width < 100 || after.width < 100 || !clear) wrong.push(`${name}, ${width} px: without scripts one covers the other`);
    await context.close();
  }
}
await browser.close();
wrong.forEach((words) => console.error(words));
console.log(`${looks} looks, ${wrong.length} complaints`);
process.exit(wrong.length ? 1 : 0);
