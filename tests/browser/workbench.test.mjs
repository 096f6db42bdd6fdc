// Tests of the workbench in a real browser, with hidden data: from a laboratory's table to an error equal to the noise. Pictures of all views go to $PICTURES.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, utimesSync, writeFileSync } from "node:fs";
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
  await page.locator(`#next [data-action=${kind}]`).first().click();
  await page.waitForSelector("#job:not([hidden])");
  await isIdle();
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
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
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
  for (const [words, value] of [["diameter of the robot", "0.55"], ["diameter of the vitreous", "20"], ["poisson ratio", "0.48"]]) {
    await page.locator("#answers label", { hasText: new RegExp(words, "i") }).locator("input").fill(value);
  }
  await page.click("#answers button");
  await page.waitForSelector("#item:visible");
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
  await slider.focus();
  for (let step = 0; step < 5; step++) await page.keyboard.press("PageUp");
  await page.waitForFunction((text) => document.getElementById("tried").textContent !== text, before);
  await picture("7-by-hand");
  await page.click("#try-reset");
});

test("the missing effect is found and added, and the error falls to the noise", async () => {
  await run("diagnose");
  await page.waitForSelector("#suspects table");
  assert.match(await page.locator("#next").textContent(), /softening/);
  await hasNoSeriousFaults("suspects");
  await picture("8-suspects");
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

test("a workbench that is killed during a job loses nothing", async () => {
  await page.locator("#next [data-action=diagnose]").first().click();
  await page.waitForSelector("#job:not([hidden])");
  server.kill("SIGKILL");
  await once(server, "exit");
  link = await start(home);
  await page.goto(`${link}#${encodeURIComponent(ITEM)}`);
  await page.waitForSelector("#item:visible");
  await page.waitForSelector("#job:not([hidden])");
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

test("models of another choice of rows are not shown", async () => {
  await page.locator("#choice summary").click();
  await page.locator("#choices select").nth(1).selectOption("unused");
  await page.click("text=Use these rows");
  await page.waitForFunction(() => document.getElementById("next").textContent.includes("record has changed"));
  assert.ok(await page.locator("#fails").isHidden());
  await page.locator("#choices select").nth(1).selectOption("held out");
  await page.locator("#choices select").first().selectOption("unused");
  await page.locator("#choices select").nth(1).selectOption("unused");
  await page.click("text=Use these rows");
  await page.waitForSelector("#fault:visible");
  assert.match(await page.locator("#fault-words").textContent(), /no cycle is fitted/);
  await page.click("#fault-close");
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

test("the page has reported no unexpected error", () => {
  // The refusals that tests above provoke are expected.
  const unexpected = faults.filter((text) => !/422|net::ERR|ERR_CONNECTION|ERR_INCOMPLETE/.test(text));
  assert.deepEqual(unexpected, []);
});
