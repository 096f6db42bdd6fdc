// Measures the workbench in a browser; one document to standard output.
import { execFileSync, spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const program = process.argv[2];
const home = mkdtempSync(join(tmpdir(), "workbench-"));

/** The paper's gel under its protocol, in closed form, with 4 µm of noise (a fixed sequence). */
function record(rows) {
  const [E, c1, c2, scale, force] = [3.527, 1.402, 47.37, 1.820902396e-3, 4.6e-6];
  const creep = (t) => (t <= 0 ? 0 : (1 - Math.exp((-E * t) / c1)) / E + t / c2);
  let state = 12345;
  const unit = () => (state = (1103515245 * state + 12345) % 2147483648) / 2147483648;
  const lines = ["time_s,force_uN,position_um,cycle"];
  for (let row = 0; row < rows; row++) {
    const t = (40 * row) / rows;
    let x = creep(t);
    for (let k = 1; 5 * k < t; k++) x += 2 * (k % 2 ? -1 : 1) * creep(t - 5 * k);
    const noise = 4 * (unit() + unit() + unit() + unit() - 2) * Math.sqrt(3);
    lines.push(`${t.toFixed(7)},${Math.floor(t / 5) % 2 ? -4.6 : 4.6},${((1e6 * force * x) / scale + (row ? noise : 0)).toFixed(3)},${1 + Math.floor(t / 10)}`);
  }
  return lines.join("\n") + "\n";
}

function experiment(name, rows) {
  mkdirSync(join(home, name));
  writeFileSync(join(home, name, "trajectory.csv"), record(rows));
  writeFileSync(join(home, name, "experiment.toml"), `[specimen]\nid = "${name}"\n[robot]\nshape = "sphere"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n[measurement]\nfile = "trajectory.csv"\nnoise_um = 4.0\nsource = "synthetic"\n`);
}

for (const rows of [800, 100_000]) {
  experiment(`rows-${rows}`, rows);
  try {
    execFileSync(program, ["sample", `rows-${rows}`, "--quiet", "--no-report"], { cwd: home, stdio: "ignore" });
  } catch (error) {
    // Exit code 1 is a result, too.
    if (error.status !== 1) throw error;
  }
}
experiment("rows-1000000", 1_000_000);
execFileSync(program, ["challenge", "new", "--out", join(home, ".hidden"), "--effect", "softening", "--strength", "30", "--seed", "7", "--quiet"]);

let server;
/** Starts the workbench; its link comes on standard output. */
function start() {
  server = spawn(program, ["workbench", ".", "--port", "0", "--quiet"], { cwd: home, stdio: ["ignore", "pipe", "inherit"] });
  return { link: new Promise((resolve) => server.stdout.once("data", (data) => resolve(String(data).trim()))) };
}
const link = await start().link;
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const found = {};
try {
  found.paint_ms = [];
  for (let time = 0; time < 7; time++) {
    const page = await browser.newPage();
    await page.goto(link);
    await page.waitForFunction(() => performance.getEntriesByName("first-contentful-paint").length > 0);
    found.paint_ms.push(await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0].startTime));
    await page.close();
  }
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  const open = async (name) => {
    await page.goto("about:blank");
    await page.goto(`${link}#${name}`);
  };
  for (const rows of [800, 100_000]) {
    await open(`rows-${rows}`);
    await page.waitForSelector("#sliders input");
    found[`slider_${rows}_ms`] = await page.evaluate(async () => {
      const [slider, told] = [document.querySelector("#sliders input"), document.getElementById("tried")];
      const times = [];
      for (let move = 0; move < 200; move++) {
        const began = performance.now();
        const drawn = new Promise((resolve) => {
          const watch = new MutationObserver(() => (watch.disconnect(), resolve()));
          watch.observe(told, { childList: true });
        });
        slider.value = String(300 + 2 * move);
        slider.dispatchEvent(new Event("input"));
        await drawn;
        times.push(performance.now() - began);
        await new Promise(requestAnimationFrame);
      }
      return times.slice(20);
    });
  }
  const began = performance.now();
  await open("rows-1000000");
  await page.waitForSelector("#item:visible canvas");
  await page.waitForFunction(() => document.getElementById("decimated").textContent.includes("1000000"));
  found.open_1000000_ms = performance.now() - began;

  await open("rows-800");
  await page.waitForSelector("#sliders input");
  await page.waitForTimeout(3000);
  const ticks = () => {
    const fields = readFileSync(`/proc/${server.pid}/stat`, "utf8").split(") ")[1].split(" ");
    return Number(fields[11]) + Number(fields[12]);
  };
  const before = ticks();
  await page.waitForTimeout(20_000);
  // A hundred ticks a second.
  found.idle_percent = (ticks() - before) / 20;

  await open("");
  await page.waitForSelector("#start:visible");
  const dropped = performance.now();
  const table = readFileSync(join(home, ".hidden", "trajectory.csv"), "utf8");
  const isIdle = () => page.waitForFunction(() => document.getElementById("job").hidden, null, { timeout: 300_000 });
  await page.setInputFiles("#table", { name: "hidden.csv", mimeType: "text/csv", buffer: Buffer.from(table) });
  await page.waitForSelector("#questions:visible");
  for (const [words, value] of [["diameter of the robot", "0.55"], ["diameter of the vitreous", "20"], ["poisson ratio", "0.48"]]) {
    await page.locator("#answers label", { hasText: new RegExp(words, "i") }).locator("input").fill(value);
  }
  await page.click("#answers button");
  for (const kind of ["sample", "diagnose", "extend"]) {
    await page.locator(`#next [data-action=${kind}]`).first().click();
    await page.waitForSelector("#job:not([hidden])");
    await isIdle();
  }
  await page.waitForFunction(() => document.querySelectorAll(".rung").length === 3);
  found.loop_ms = performance.now() - dropped;

  // A workbench that is killed, and started again.
  const killed = performance.now();
  server.kill("SIGKILL");
  await page.waitForSelector("#lost:not([hidden])");
  found.noticed_ms = performance.now() - killed;
  const again = start();
  const restarted = performance.now();
  await again.link;
  await page.waitForSelector("#lost", { state: "hidden" });
  found.resumed_ms = performance.now() - restarted;

  for (let number = 0; number < 300; number++) experiment(`eye-${number}`, 800);
  await open("");
  const reloaded = performance.now();
  await page.reload();
  await page.waitForFunction(() => document.querySelectorAll("#project-rows tr").length > 300);
  found.table_ms = performance.now() - reloaded;
} finally {
  await browser.close();
  server.kill("SIGKILL");
  rmSync(home, { recursive: true, force: true, maxRetries: 20, retryDelay: 200 });
}
console.log(JSON.stringify(found, null, 1));
