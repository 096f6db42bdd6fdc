// Tests of the workbench in a real browser, with hidden data: from a laboratory's table to an error equal to the noise. Pictures of all views go to $PICTURES.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, utimesSync, writeFileSync } from "node:fs";
import { request } from "node:http";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

const program = process.env.VITREO_UQ;
const pictures = process.env.PICTURES ?? mkdtempSync(join(tmpdir(), "pictures-"));
const cohort = process.env.COHORT;
const axe = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
/** Name of the table, with German and Chinese letters. */
const TABLE = "Glaskörper 眼睛.csv";
const ITEM = "Glaskörper-眼睛";
/** Maximum duration of a job in ms. It is far longer than needed, so that a busy machine causes no failure. */
const PATIENCE_MS = 300_000;

let home, server, link, browser, page;
const faults = [];

/** Starts the workbench in a folder, and returns its link. */
async function start(folder) {
  server = spawn(program, ["workbench", ".", "--port", "0", "--quiet"], { cwd: folder, stdio: ["ignore", "pipe", "inherit"] });
  const [line] = await once(server.stdout, "data");
  return String(line).trim();
}
/** Ends the workbench, starts it in another folder, and opens it there. */
async function startIn(folder) {
  server.kill("SIGKILL");
  await once(server, "exit");
  await page.goto("about:blank");
  link = await start(folder);
  await page.goto(link);
}
/** Number of the process that runs the command of a folder's job. */
async function runningCommand(folder) {
  for (;;) {
    const { process } = JSON.parse(readFileSync(join(folder, ".vitreo-uq-workbench", "job.json"), "utf8"));
    if (process.number > 0) return process.number;
    await page.waitForTimeout(10);
  }
}
/** Folder of its own for a test. */
const folder = () => mkdtempSync(join(tmpdir(), "workbench-"));
/** Copies an experiment of the cohort. */
const copyRecord = (name, to) => cpSync(join(cohort, name), to, { recursive: true });
/** Whether the whole element is in the window without scrolling. */
async function assertInView(selector) {
  const element = page.locator(selector).first();
  await element.waitFor();
  const [box, size] = [await element.boundingBox(), page.viewportSize()];
  assert.ok(box.x >= 0 && box.y >= 0 && box.x + box.width <= size.width + 1 && box.y + box.height <= size.height + 1, `${selector} at ${JSON.stringify(box)} is outside ${JSON.stringify(size)}`);
}
/** Moves the focus by the tabulator to an element, and presses Enter. */
async function tabToAndPress(selector) {
  await page.waitForSelector(`${selector}:not([disabled])`);
  for (let step = 0; step < 200; step++) {
    await page.keyboard.press("Tab");
    if (await page.evaluate((own) => document.activeElement?.matches(own), selector)) return page.keyboard.press("Enter");
  }
  assert.fail(`${selector} is not reached by the keyboard`);
}
const once = (emitter, event) => new Promise((resolve) => emitter.once(event, (...values) => resolve(values)));

/** Returns the record of an experiment as a table with semicolons, decimal commas and other column names. */
function asLaboratoriesWrite(folder) {
  const [head, ...rows] = readFileSync(join(folder, "trajectory.csv"), "utf8").trim().split("\n");
  assert.deepEqual(head.split(",").slice(0, 3), ["time_s", "force_uN", "position_um"]);
  const cells = rows.map((row) => row.split(",").slice(0, 3).map((cell) => cell.replace(".", ",")).join(";"));
  return ["Zeit [s];Kraft [µN];Weg [µm]", ...cells].join("\r\n") + "\r\n";
}

const picture = (name) => page.screenshot({ path: join(pictures, `${name}.png`), fullPage: true });
const isIdle = () => page.waitForFunction(() => document.getElementById("job").hidden, null, { timeout: PATIENCE_MS });

/** Presses a button of a job, and waits for the job's end. */
async function run(kind) {
  await page.evaluate(() => {
    globalThis.times = [];
    new MutationObserver(() => globalThis.times.push(document.getElementById("job-time").textContent)).observe(document.getElementById("job-time"), { childList: true });
  });
  await page.locator(`#next [data-action=${kind}]`).first().click();
  await page.waitForSelector("#job:not([hidden])");
  await isIdle();
  const times = await page.evaluate(() => globalThis.times);
  // Other jobs end within seconds.
  if (kind === "diagnose") assert.ok(times.some((text) => /^\d+ %/.test(text)), `no percentage in ${JSON.stringify(times)}`);
  assert.ok(await page.locator("#fault").isHidden(), await page.locator("#fault-words").textContent());
}

async function hasNoSeriousFaults(name) {
  await page.evaluate(readFileSync(axe, "utf8"));
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  const serious = violations.filter((own) => own.impact === "serious" || own.impact === "critical");
  assert.deepEqual(serious.map((own) => `${name}: ${own.id}: ${own.nodes.map((node) => node.target).join(" ")}`), []);
}

before(async () => {
  mkdirSync(pictures, { recursive: true });
  home = mkdtempSync(join(tmpdir(), "workbench-"));
  execFileSync(program, ["challenge", "new", "--out", join(home, ".hidden"), "--effect", "softening", "--strength", "30", "--seed", "7", "--quiet"]);
  writeFileSync(join(home, ".table.csv"), asLaboratoriesWrite(join(home, ".hidden")));
  link = await start(home);
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
  page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  page.on("dialog", (dialog) => dialog.accept());
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(`${message.text()} ${message.location().url}`));
});

after(async () => {
  await browser?.close();
  server?.kill("SIGKILL");
  if (home) rmSync(home, { recursive: true, force: true, maxRetries: 20, retryDelay: 200 });
});

test("an empty folder asks for a table", async () => {
  await page.goto(link);
  await page.waitForSelector("#start:visible");
  await hasNoSeriousFaults("start");
  await picture("1-start");
});

test("an error names the line of a bad table", async () => {
  const rows = readFileSync(join(home, ".table.csv"), "utf8").replace(/\r\n[^\r]*\r\n$/, "\r\n") + "40,1;4,6;zwölf\r\n";
  await page.setInputFiles("#table", { name: "falsch.csv", mimeType: "text/csv", buffer: Buffer.from(rows) });
  await page.waitForSelector("#fault:visible, #questions:visible");
  const words = await page.locator("#fault-words").textContent();
  assert.match(words, /^falsch\.csv, line 801/);
  assert.match(words, /zwölf/);
  await picture("2-wrong-table");
  await page.click("#fault-close");
  assert.ok(!existsSync(join(home, "falsch")), "a refused table leaves no files");
});

test("a table with semicolons and decimal commas becomes an experiment", async () => {
  await page.setInputFiles("#table", { name: TABLE, mimeType: "text/csv", buffer: readFileSync(join(home, ".table.csv")) });
  await page.waitForSelector("#questions:visible, #fault:visible");
  assert.ok(await page.locator("#fault").isHidden(), await page.locator("#fault-words").textContent());
  await hasNoSeriousFaults("questions");
  await picture("3-questions");
  await page.setViewportSize({ width: 1280, height: 800 });
  await assertInView("#answers button");
  await page.setViewportSize({ width: 1440, height: 900 });
  // A column is given another role, and its own again. Until a slow server replies, the questions take no answers: they belong to other roles.
  await page.route("**/api/init", async (route) => {
    await new Promise((done) => setTimeout(done, 500));
    await route.continue();
  });
  const [time, position] = [0, 2].map((place) => page.locator(".preview select").nth(place));
  const shown = await page.$(".preview");
  await position.selectOption("force");
  assert.ok(await page.locator("#answers").evaluate((form) => form.inert));
  await page.waitForFunction((preview) => !preview.isConnected, shown);
  await position.selectOption("as recognised");
  assert.equal(await time.inputValue(), "as recognised");
  for (const [words, value] of [["diameter of the robot", "0.55"], ["diameter of the vitreous", "20"], ["poisson ratio", "0.48"]]) {
    await page.locator("#answers label", { hasText: new RegExp(words, "i") }).locator("input").fill(value);
  }
  await page.click("#answers button");
  await page.waitForSelector("#item:visible");
  await page.unroute("**/api/init");
  assert.ok(existsSync(join(home, ITEM, "experiment.toml")));
  assert.match(await page.locator("#parts").textContent(), /800 rows|4 cycles/);
  await hasNoSeriousFaults("record");
  await picture("4-record");
});

test("a selected time range is left out", async () => {
  const plot = await page.locator("#plot-position .u-over").boundingBox();
  await page.mouse.move(plot.x + 0.52 * plot.width, plot.y + 50);
  await page.mouse.down();
  await page.mouse.move(plot.x + 0.54 * plot.width, plot.y + 80, { steps: 5 });
  await page.mouse.up();
  await page.locator("#choice summary").click();
  await page.click("text=Leave out the shown time range");
  await page.waitForSelector("#choices li");
  // A change of the folder reloads the record, and keeps the choice that is not applied yet.
  const shownAnew = page.waitForResponse((response) => response.url().includes("/api/study")).then(() => page.waitForResponse((response) => response.url().includes("/api/rows")));
  utimesSync(join(home, ITEM, "experiment.toml"), 1, 1);
  await shownAnew;
  assert.equal(await page.locator("#choices li").count(), 1);
  await picture("4b-rows");
  await page.click("text=Use these rows");
  await page.waitForFunction(() => document.getElementById("parts").textContent.includes("left out"));
  const [, from, to] = readFileSync(join(home, ITEM, "experiment.toml"), "utf8").match(/^left_out_s = \[\[([\d.]+), ([\d.]+)\]\]$/m).map(Number);
  assert.ok(from > 20 && to < 22.5 && to > from, `${from} ${to}`);
});

test("the model is fitted, and fails", async () => {
  await run("sample");
  await page.waitForSelector("#fails:visible");
  assert.ok((await page.locator("#map button").count()) > 10);
  await picture("5-fails");
  for (const row of await page.locator("#map tr").all()) {
    const title = await row.locator("th").textContent();
    await row.locator("button").first().click();
    await page.waitForFunction((text) => document.getElementById("cell").textContent.startsWith(text), title);
    const p = Number((await row.locator("td.p").textContent()).match(/p = (.*)/)[1]);
    assert.equal(await row.evaluate((own) => own.classList.contains("quiet")), p >= 0.05, title);
  }
  await page.locator("#map tr", { hasText: "time since the last force step" }).locator("button").first().click();
  await page.waitForFunction(() => document.getElementById("window").selectedIndex > 0);
  await picture("6-a-cell-of-the-map");
  await page.selectOption("#window", "");
});

test("an effect is tried by hand", async () => {
  await page.selectOption("#try-effect", "softening");
  const slider = page.locator("#sliders label", { hasText: "softening" }).locator("input");
  await slider.waitFor();
  const told = () => page.locator("#tried").textContent();
  await page.waitForFunction(() => document.getElementById("tried").textContent.includes("µm"));
  const before = await told();
  const residuals = () => page.evaluate(() => document.querySelector("#plot-residual canvas").toDataURL());
  const drawn = await residuals();
  await slider.focus();
  for (let step = 0; step < 5; step++) await page.keyboard.press("PageUp");
  await page.waitForFunction((text) => document.getElementById("tried").textContent !== text, before);
  assert.notEqual(await residuals(), drawn, "the residuals follow the sliders");
  await picture("7-by-hand");
  await page.click("#try-reset");
});

test("another force and another robot are predicted with sliders", async () => {
  const slider = (words) => page.locator("#predict-sliders label", { hasText: words }).locator("input");
  await slider("Force").waitFor();
  const said = () => page.locator("#predict-words").textContent();
  const changed = (text) => page.waitForFunction((before) => document.getElementById("predict-words").textContent !== before, text);
  await page.waitForFunction(() => document.getElementById("predict-words").textContent.includes("position at"));
  const median = (text) => parseFloat(/position at [^:]*: ([\d.]+)/.exec(text)[1]);
  const before = await said();
  // Force and size have logarithmic sliders: 1000 steps are a factor of 250, or of 25. The position is proportional to the force.
  const keys = async (input, key, times) => {
    await input.focus();
    for (let step = 0; step < times; step++) await page.keyboard.press(key);
  };
  await keys(slider("Force"), "ArrowLeft", 20);
  await changed(before);
  await page.waitForTimeout(600);
  const weaker = await said();
  assert.ok(Math.abs(median(weaker) / median(before) - 250 ** -0.02) < 0.01, `${before} | ${weaker}`);
  await keys(slider("size"), "ArrowRight", 60);
  await changed(weaker);
  await page.waitForTimeout(1200);
  const larger = await said();
  assert.ok(median(larger) < 0.9 * median(weaker), `a larger robot moves less: ${weaker} | ${larger}`);
  await keys(slider("Distance"), "ArrowRight", 100);
  await page.waitForFunction(() => document.getElementById("predict-words").textContent.includes("time to reach"));
  await page.locator("#predict").scrollIntoViewIfNeeded();
  await hasNoSeriousFaults("predict");
  await picture("7b-prediction");
});

test("the missing effect is found and added, and the error falls to the noise", async () => {
  await run("diagnose");
  await page.waitForSelector("#suspects table");
  assert.match(await page.locator("#next").textContent(), /softening/);
  const [study] = readdirSync(join(home, "vitreo-uq-out"));
  const answer = JSON.parse(execFileSync(program, ["challenge", "reveal", join(home, ".hidden"), "--study", join(home, "vitreo-uq-out", study), "--json", "-", "--quiet"]));
  assert.equal(answer.right, true, "the study of a table in another layout is judged, although some rows are left out");
  await hasNoSeriousFaults("suspects");
  // Another effect is drawn beside the claimed one.
  assert.doesNotMatch(await page.locator("#fingerprint-of").textContent(), /Dashed/);
  await page.locator("#suspects tbody tr").nth(1).hover();
  await page.waitForFunction(() => document.getElementById("fingerprint-of").textContent.includes("Dashed: softening, the claimed effect"));
  await picture("8-suspects");
  const figure = await page.locator("#files a", { hasText: /^pdf$/ }).first().getAttribute("href");
  const bytes = await page.evaluate(async (href) => (await (await fetch(href)).text()).slice(0, 5), figure);
  assert.equal(bytes, "%PDF-");
  // Another tab shows the same job.
  const other = await browser.newPage();
  await other.goto(link);
  await page.locator("#next [data-action=extend]").click();
  await other.waitForSelector("#job:not([hidden])");
  await other.close();
  await isIdle();
  await page.waitForFunction(() => document.querySelectorAll(".rung").length === 3);
  const [m0, m1, noise] = (await page.locator(".rung .number").allTextContents()).map(parseFloat);
  assert.ok(m0 > 1.15 * noise && m1 < 1.15 * noise, `errors ${m0} and ${m1} µm, noise ${noise} µm`);
  assert.deepEqual(await page.locator("#revision option").allTextContents().then((all) => all.length), 2);
  await hasNoSeriousFaults("ladder");
  await picture("9-the-error-falls");
  await page.evaluate(() => scrollTo(0, 0));
  await page.screenshot({ path: join(pictures, "workbench.png") });
});

test("one screen shows the next step, the curves and the sliders", async () => {
  for (const [width, height] of [[1280, 800], [1440, 900], [3840, 2160]]) {
    await page.setViewportSize({ width, height });
    await page.evaluate(() => scrollTo(0, 0));
    for (const selector of ["#next button", "#plot-position canvas", "#plot-residual canvas", "#sliders label"]) await assertInView(selector);
    await assertInView("#sliders label:last-child");
    await page.screenshot({ path: join(pictures, `9b-${width}.png`) });
  }
  const right = await page.evaluate(() => Math.max(...[...document.querySelectorAll(".bench > *")].map((own) => own.getBoundingClientRect().right)));
  assert.ok(right > 3700, `the page ends at ${right} of 3840 px`);
  await page.setViewportSize({ width: 800, height: 900 });
  await page.selectOption("#revision", "m0");
  await page.locator("#suspects tbody button").first().scrollIntoViewIfNeeded();
  await assertInView("#suspects tbody button");
  await page.setViewportSize({ width: 1440, height: 900 });
  await page.selectOption("#revision", "m1");
});

test("two revisions are compared in one plot and one corner plot", async () => {
  const ink = () => page.evaluate(() => document.querySelector("#plot-position canvas").toDataURL());
  const before = await ink();
  await page.selectOption("#compared", "m0");
  await page.waitForFunction((text) => document.querySelector("#plot-position canvas").toDataURL() !== text, before);
  await page.locator("#parts summary", { hasText: /^Posterior$/ }).click();
  await page.waitForSelector(".corner > svg");
  const boxes = page.locator("#parts .tools input[type=checkbox]");
  assert.equal(await boxes.count(), 5, "three parameters of the law, one of the effect, and the noise");
  const drawn = await page.locator(".corner").innerHTML();
  await boxes.nth(0).uncheck();
  await page.waitForFunction((text) => document.querySelector(".corner").innerHTML !== text, drawn);
  await picture("9b-two-revisions");
  await page.locator("#parts summary", { hasText: /^Posterior$/ }).click();
  await page.selectOption("#compared", "");
});

test("a drag along the values zooms them in, and a double click shows all", async () => {
  await page.evaluate(() => scrollTo(0, 0));
  const over = page.locator("#plot-position .u-over");
  const box = await over.boundingBox();
  const ticks = () => page.locator("#plot-position canvas").evaluate((own) => own.toDataURL());
  const before = await ticks();
  await page.mouse.move(box.x + 200, box.y + 0.2 * box.height);
  await page.keyboard.down("Shift");
  await page.mouse.down();
  await page.mouse.move(box.x + 205, box.y + 0.6 * box.height, { steps: 5 });
  await page.mouse.up();
  await page.keyboard.up("Shift");
  await page.mouse.move(box.x - 40, box.y);
  await page.waitForFunction((text) => document.querySelector("#plot-position canvas").toDataURL() !== text, before);
  await picture("9b-values");
  await over.dblclick();
  await page.mouse.move(box.x - 40, box.y);
  await page.waitForFunction((text) => document.querySelector("#plot-position canvas").toDataURL() === text, before);
});

test("the Back button leads to what was open before", async () => {
  await page.click("#to-project");
  await page.waitForSelector("#project:visible");
  assert.match(await page.locator("#project-rows tr", { hasText: ITEM }).textContent(), /softening/);
  await hasNoSeriousFaults("project");
  await picture("9c-project");
  await page.goBack();
  await page.waitForSelector("#item:visible");
  assert.equal(await page.locator("#revision").inputValue(), "m1");
  await page.goForward();
  await page.waitForSelector("#project:visible");
  await page.locator("#project-rows a", { hasText: ITEM }).click();
  await page.waitForSelector("#item:visible");
});

test("what was learnt in vain is said", async () => {
  await page.route("**/api/study?**", async (route) => {
    const response = await route.fetch();
    const study = await response.json();
    study.revisions.forEach((own) => Object.assign(own, { diagnosis: null, learned: { verdict: { kind: "nothing", sentence: "No function of a state explains the residuals." }, function: null, formula: null } }));
    if (study.revisions.length > 0) study.revisions.forEach((own) => (own.diagnosis = { verdict: { kind: "unexplained", effects: [], sentence: "" }, candidates: [] }));
    await route.fulfill({ response, json: study });
  });
  await page.route("**/file?**fingerprints**", (route) => route.fulfill({ contentType: "text/csv", body: "time_s,left_um\n" }));
  await page.reload();
  await page.waitForFunction(() => document.getElementById("next").textContent.includes("Nothing was learnt"));
  await page.unrouteAll({ behavior: "wait" });
  await page.reload();
  await page.waitForSelector("#next button");
});

test("a workbench that is killed during a job loses nothing, and the page goes on by itself", async () => {
  await page.locator("#next [data-action=diagnose]").first().click();
  await page.waitForSelector("#job:not([hidden])");
  const command = await runningCommand(home);
  // The command is halted, so that it does not end before the page has shown it. It runs on while the workbench ends, because the system ends a halted
  // command that loses its parent.
  process.kill(command, "SIGSTOP");
  await page.waitForFunction(() => /since the start/.test(document.getElementById("job-time").textContent));
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  await assertInView("#job-progress");
  process.kill(command, "SIGCONT");
  server.kill("SIGKILL");
  await once(server, "exit");
  process.kill(command, "SIGSTOP");
  await page.waitForSelector("#lost:not([hidden])", { timeout: 2000 });
  assert.ok(await page.locator("#job").isHidden(), "no bar runs on");
  await picture("9d-lost");
  const before = link;
  link = await start(home);
  assert.equal(link, before, "the same port and token");
  await page.waitForSelector("#lost", { state: "hidden", timeout: 3000 });
  await page.waitForSelector("#job:not([hidden])");
  process.kill(command, "SIGCONT");
  await isIdle();
  await page.waitForFunction(() => /no missing effect|may be missing|lacks|explains/i.test(document.getElementById("missing-sentence").textContent), null, { timeout: 20_000 });
});

test("a stopped job leaves no file half-written", async () => {
  await page.locator("#next [data-action=diagnose]").first().click();
  await page.waitForSelector("#job:not([hidden])");
  const began = Date.now();
  await page.click("#job-stop");
  await isIdle();
  assert.ok(Date.now() - began < 3000, "the job ends within 3 s: one second for the command, and the time of two requests");
  await page.waitForSelector("#fault:visible");
  assert.match(await page.locator("#fault-words").textContent(), /stopped/);
  await page.click("#fault-close");
});

test("models of another choice of rows are not shown, and come back with it", async () => {
  await page.locator("#choice summary").click();
  await page.locator("#choices select").nth(1).selectOption("unused");
  await page.click("text=Use these rows");
  await page.waitForFunction(() => document.getElementById("next").textContent.includes("record has changed"));
  assert.ok(await page.locator("#fails").isHidden());
  await page.locator("#choices select").nth(1).selectOption("held out");
  await page.click("text=Use these rows");
  await page.waitForSelector("#fails:visible");
  assert.equal(await page.locator("#revision option").count(), 2);
  await page.locator("#choices select").first().selectOption("unused");
  for (const cycle of [1, 2, 3]) await page.locator("#choices select").nth(cycle).selectOption("unused");
  await page.click("text=Use these rows");
  await page.waitForSelector("#fault:visible");
  assert.match(await page.locator("#fault-words").textContent(), /no cycle is fitted/);
  await page.click("#fault-close");
});

/** Opens the form under the plots and waits for its contents. A record that still loads closes it, so it is opened as often as needed. */
const openDescription = (item, words) => page.waitForFunction(([item, words]) => {
  document.getElementById("description").open = true;
  return document.getElementById("new-name").value === item && document.getElementById("description-text").value.includes(words);
}, [item, words]);

test("a wrong description is corrected, and a record is renamed, copied, deleted and brought back", async () => {
  await page.goto(`${link}#${encodeURIComponent(ITEM)}`);
  await openDescription(ITEM, "diameter_mm");
  const text = page.locator("#description-text");
  const good = await text.inputValue();
  await text.fill(good.replace(/diameter_mm = 0\.55\b/, "diameter_mm = -3"));
  await page.click("text=Save the description");
  await page.waitForSelector("#fault:visible");
  assert.equal(readFileSync(join(home, ITEM, "experiment.toml"), "utf8"), good, "a refused description is not written");
  await page.click("#fault-close");
  await text.fill(good.replace(/diameter_mm = 0\.55\b/, "diameter_mm = 0.551"));
  await page.click("text=Save the description");
  await page.waitForFunction(() => document.getElementById("next").textContent.includes("record has changed"));
  await openDescription(ITEM, "0.551");
  await text.fill(good);
  await page.click("text=Save the description");
  await page.waitForSelector("#fails:visible");
  await openDescription(ITEM, "diameter_mm");
  await page.click("#delete-revision");
  await page.waitForFunction(() => document.querySelectorAll("#revision option").length === 1);
  await page.click("#undo-do");
  await page.waitForFunction(() => document.querySelectorAll("#revision option").length === 2);
  const downloaded = async (text) => {
    const download = page.waitForEvent("download");
    await page.locator("#files a", { hasText: text }).first().click();
    return readFileSync(await (await download).path(), "utf8");
  };
  assert.match(await downloaded(".zip"), /experiment\.toml/);
  assert.match(await downloaded("parameters.csv"), /^parameter,median,90 % interval,unit\r\nE,/);
  assert.match(await downloaded("parameters.tex"), /\nc\$_\{1\}\$ & .* & Pa\$\\cdot\$s \\\\\n/);
  await openDescription(ITEM, "diameter_mm");
  await page.fill("#new-name", "Kopie");
  await page.click("text=Copy under this name");
  await page.waitForFunction(() => location.hash === "#Kopie");
  await openDescription("Kopie", "diameter_mm");
  await page.fill("#new-name", "other");
  await page.click("#rename button[value=rename]");
  await page.waitForFunction(() => location.hash === "#other");
  assert.ok(existsSync(join(home, "other", "experiment.toml")) && !existsSync(join(home, "Kopie")));
  await openDescription("other", "diameter_mm");
  await page.click("#delete");
  await page.waitForSelector("#undo:not([hidden])");
  assert.ok(!existsSync(join(home, "other")));
  await picture("9e-undo");
  await page.click("#undo-do");
  await page.waitForFunction(() => location.hash === "#other");
  assert.ok(existsSync(join(home, "other", "experiment.toml")));
  rmSync(join(home, "other"), { recursive: true });
  await page.goto(`${link}#${encodeURIComponent(ITEM)}`);
});

test("an upload of impossible length is refused before it is sent", async () => {
  const { hostname, port, pathname, host } = new URL(link);
  const status = await new Promise((resolve, reject) => {
    const sent = request({ hostname, port, path: `${pathname}api/table?name=x.csv`, method: "POST", headers: { host, "content-length": 1e12 } }, (response) => resolve(response.statusCode));
    sent.on("error", reject);
    sent.flushHeaders();
  });
  assert.equal(status, 422);
});

test("the page works in dark mode and on a narrow screen", async () => {
  await page.emulateMedia({ colorScheme: "dark" });
  await hasNoSeriousFaults("dark");
  await picture("10-dark");
  await page.setViewportSize({ width: 720, height: 900 });
  await picture("11-narrow");
  const isTooWide = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth + 1);
  assert.ok(!isTooWide, "no element is wider than the window");
});

test("groups are compared", async () => {
  await page.setViewportSize({ width: 1440, height: 900 });
  await page.emulateMedia({ colorScheme: "light" });
  for (const name of ["bovine-01-anterior", "bovine-02-anterior", "porcine-01-anterior", "porcine-02-anterior"]) cpSync(join(cohort, name), join(home, name), { recursive: true });
  await page.goto("about:blank");
  await page.goto(link);
  await page.waitForSelector("#compare:visible");
  await picture("12-compare");
  await page.click("#compare-start");
  await page.waitForSelector("#job:not([hidden])");
  await isIdle();
  assert.ok(await page.locator("#fault").isHidden(), await page.locator("#fault-words").textContent());
  await page.waitForSelector("#sheet:visible");
  assert.ok((await page.locator("#sheet img").count()) > 1);
  await page.waitForFunction(() => [...document.querySelectorAll("#sheet img")].slice(0, 1).every((own) => own.complete && own.naturalWidth > 0));
  await hasNoSeriousFaults("groups");
  await picture("13-groups");
});

test("the sample record leads to the hidden effect in four presses of a key", async () => {
  const own = folder();
  await page.setViewportSize({ width: 1280, height: 800 });
  await startIn(own);
  for (const action of ["#example", "#next [data-action=sample]", "#next [data-action=diagnose]", "#next [data-action=extend]"]) {
    await assertInView(action);
    await tabToAndPress(action);
    await page.waitForSelector("#job:not([hidden])");
    await isIdle();
    assert.ok(await page.locator("#fault").isHidden(), await page.locator("#fault-words").textContent());
  }
  await page.waitForFunction(() => document.querySelectorAll(".rung").length === 3);
  const [m0, m1, noise] = (await page.locator(".rung .number").allTextContents()).map(parseFloat);
  assert.ok(m0 > 1.15 * noise && m1 < 1.15 * noise, `errors ${m0} and ${m1} µm, noise ${noise} µm`);
  assert.match(await page.locator("#revision option").last().textContent(), /softening/);
  await page.screenshot({ path: join(pictures, "14-sample.png") });
  rmSync(own, { recursive: true, force: true, maxRetries: 20, retryDelay: 200 });
});

test("three hundred records are listed, sorted, filtered and marked", async () => {
  const own = folder();
  for (let number = 0; number < 300; number++) {
    copyRecord(number % 2 ? "bovine-01-anterior" : "porcine-01-anterior", join(own, `eye-${number}`));
    const path = join(own, `eye-${number}`, "experiment.toml");
    writeFileSync(path, readFileSync(path, "utf8").replace(/^id = .*$/m, `id = "eye-${number}"`));
  }
  const began = Date.now();
  await startIn(own);
  await page.waitForFunction(() => document.querySelectorAll("#project-rows tr").length === 300);
  console.log(`300 records: ${Date.now() - began} ms with the start of the workbench`);
  await page.locator("#project-head button", { hasText: "record" }).click();
  assert.equal(await page.locator("#project-rows a").first().textContent(), "eye-299");
  await page.fill("#project-filter", "bovine");
  await page.waitForFunction(() => document.querySelectorAll("#project-rows tr").length === 150);
  await page.fill("#project-filter", "eye-7");
  for (const name of ["eye-7", "eye-70"]) await page.locator(`#project-rows input[aria-label="Mark ${name}"]`).check();
  await page.click("#project-sample");
  await page.waitForSelector("#job:not([hidden])");
  await isIdle();
  assert.ok(await page.locator("#fault").isHidden(), await page.locator("#fault-words").textContent());
  await page.waitForFunction(() => /\d \(.* to .*\)/.test(document.getElementById("project-rows").textContent));
  const download = page.waitForEvent("download");
  await page.click("#project-csv");
  const csv = readFileSync(await (await download).path(), "utf8");
  assert.match(csv, /^record,species,region,revision,effects,.*median/);
  assert.equal(csv.trim().split("\r\n").filter((line) => line.includes(",m0,")).length, 2);
  await picture("15-project");
  rmSync(own, { recursive: true, force: true, maxRetries: 20, retryDelay: 200 });
});

test("a long record is drawn as bars from the lowest to the highest value of each pixel", async () => {
  const own = folder();
  await page.setViewportSize({ width: 1440, height: 900 });
  copyRecord("porcine-01-anterior", join(own, "long"));
  // A fast oscillation: its lowest and highest values alone would look like two crossing waves.
  const rows = Array.from({ length: 60_000 }, (_, row) => `${(row / 1000).toFixed(4)},${row % 15_000 < 7_500 ? 10 : 0},${(100 + 50 * Math.sin(2.1 * row)).toFixed(3)},${1 + Math.floor(row / 15_000)}`);
  writeFileSync(join(own, "long", "trajectory.csv"), ["time_s,force_uN,position_um,cycle", ...rows].join("\n") + "\n");
  await startIn(own);
  await page.locator("#project-rows a").click();
  await page.waitForSelector("#plot-position canvas");
  await page.waitForFunction(() => document.getElementById("decimated").textContent.includes("lowest and highest"));
  const filled = await page.evaluate(() => {
    const canvas = document.querySelector("#plot-position canvas");
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    const isInk = (x, y) => data[4 * (y * width + x) + 3] > 128 && data[4 * (y * width + x)] < 120;
    return [0.4, 0.5, 0.6, 0.7].map((share) => {
      const [x, ys] = [Math.round(share * width), []];
      for (let y = 0; y < height; y++) if (isInk(x, y)) ys.push(y);
      return ys.length / (ys[ys.length - 1] - ys[0] + 1);
    });
  });
  await picture("16-long");
  assert.ok(filled.every((share) => share > 0.95), `filled shares of columns: ${filled}`);
  rmSync(own, { recursive: true, force: true, maxRetries: 20, retryDelay: 200 });
});

test("the page has reported no unexpected error", () => {
  // The refusals that tests above provoke are expected.
  const unexpected = faults.filter((text) => !/422|net::ERR|ERR_CONNECTION|ERR_INCOMPLETE/.test(text));
  assert.deepEqual(unexpected, []);
});
