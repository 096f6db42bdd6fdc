// @ts-check
// Prediction of other forces and robots with sliders. The server computes every curve.
import { ask, at, fault, make, query, send, shown } from "./requests.js";

/** @typedef {{force_un: number, duration_s: number, distance_um: number, changes_robot: boolean}} Limits */
/** @typedef {{name: string, words: string, low: number, high: number, value: number, unit: string, isLogarithmic: boolean, ofRobot?: boolean, none?: string}} Choice */

/** @type {any} */
const uPlot = /** @type {any} */ (globalThis).uPlot;
/** @param {string} name */
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class PredictionView {
  constructor() {
    /** Record and revision that are shown. */ this.of = "";
    /** @type {any} */ this.plot = null;
    /** @type {Record<string, number>} */ this.values = {};
    this.isAsking = false;
    this.isStale = false;
    /** @type {any} */ this.last = null;
    addEventListener("resize", () => this.plot?.setSize({ width: this.width(), height: 280 }));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(this.last));
  }

  width() {
    return Math.max(200, at("predict-plot").clientWidth);
  }

  /** Shows the sliders of a revision, and its first prediction. `posterior` changes whenever the revision is fitted anew.
   * @param {string} item @param {string|null} revision @param {string} posterior */
  async show(item, revision, posterior) {
    const of = revision === null ? "" : JSON.stringify([item, revision, posterior]);
    if (of === this.of) return;
    this.of = of;
    at("predict").hidden = true;
    if (revision === null) return;
    /** @type {Limits|null} */
    const limits = await ask(`api/foresight?${query({ item, revision })}`);
    // Records without a robot, and models of one record, have no prediction.
    if (of !== this.of || limits === null) return;
    /** @type {Choice[]} */
    const choices = [
      { name: "force_un", words: "Force", low: 0.02 * limits.force_un, high: 5 * limits.force_un, value: limits.force_un, unit: "µN", isLogarithmic: true },
      { name: "hold_s", words: "Hold", low: 0.01 * limits.duration_s, high: 2 * limits.duration_s, value: 0.25 * limits.duration_s, unit: "s", isLogarithmic: true },
      { name: "rest_s", words: "Rest", low: 0, high: limits.duration_s, value: 0.25 * limits.duration_s, unit: "s", isLogarithmic: false },
      { name: "distance_um", words: "Distance", low: 0, high: 2 * limits.distance_um, value: 0, unit: "µm", isLogarithmic: false, none: "none" },
      { name: "size", words: "Robot’s size", low: 0.2, high: 5, value: 1, unit: "times the record’s", isLogarithmic: true, ofRobot: true },
      { name: "aspect", words: "Robot’s length over diameter", low: 0, high: 12, value: 0, unit: "(ellipsoid along the force)", isLogarithmic: false, ofRobot: true, none: "as in the record" },
    ];
    const used = choices.filter((choice) => limits.changes_robot || !choice.ofRobot);
    this.values = { size: 1, aspect: 0, ...Object.fromEntries(used.map((choice) => [choice.name, choice.value])) };
    at("predict-sliders").replaceChildren(...used.map((choice) => this.slider(choice)));
    at("predict").hidden = false;
    this.request();
  }

  /** @param {Choice} choice */
  slider({ name, words, low, high, value, unit, isLogarithmic, none }) {
    const bent = isLogarithmic ? Math.log : (/** @type {number} */ own) => own;
    const straight = isLogarithmic ? Math.exp : (/** @type {number} */ own) => own;
    const [from, to] = [bent(low), bent(high)];
    const text = (/** @type {number} */ own) => (none && own === 0 ? none : `${shown(own, 4)} ${unit}`);
    const output = make("output", { textContent: text(value) });
    const input = make("input", { type: "range", min: "0", max: "1000", step: "1", value: String((1000 * (bent(value) - from)) / (to - from)) });
    input.setAttribute("aria-label", `${words} (${unit})`);
    input.addEventListener("input", () => {
      let own = Number(straight(from + ((to - from) * Number(/** @type {HTMLInputElement} */ (input).value)) / 1000).toPrecision(3));
      // A body shorter than a third of its diameter has no use here.
      if (name === "aspect" && own > 0 && own < 0.3) own = 0;
      output.textContent = text(own);
      this.values[name] = own;
      this.request();
    });
    return make("label", { className: "slider" }, [make("span", { textContent: words }), input, output]);
  }

  /** Requests the present prediction. Only one request runs at a time, and the last position of the sliders is always requested. */
  request() {
    if (this.isAsking) {
      this.isStale = true;
      return;
    }
    this.isAsking = true;
    const of = this.of;
    const [item, revision] = JSON.parse(of);
    send("api/predict", { item, revision, ...this.values })
      .then((found) => {
        if (of !== this.of) return;
        at("predict-words").textContent = `${found.apparatus}: ${found.sentences.join("; ")}.`;
        this.draw(found);
      })
      .catch(fault)
      .finally(() => {
        this.isAsking = false;
        if (this.isStale) {
          this.isStale = false;
          if (this.of) this.request();
        }
      });
  }

  /** @param {any} found */
  draw(found) {
    if (!found) return;
    this.last = found;
    const { q05, q25, median, q75, q95 } = found.position_um;
    const data = [found.time_s, q05, q95, q25, q75, median];
    const [ink, line, blue] = ["--ink", "--line", "--link"].map(colour);
    this.plot?.destroy();
    const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 } };
    const number = (/** @type {any} */ _, /** @type {number|null} */ value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(5))));
    const limit = (/** @type {string} */ label) => ({ label, stroke: blue, width: 0.5, value: number, points: { show: false } });
    this.plot = new uPlot({
      width: this.width(),
      height: 280,
      scales: { x: { time: false } },
      axes: [{ ...axis, label: "time (s)", size: 34, labelSize: 20 }, { ...axis, label: "position (µm)", size: 70, labelSize: 20 }],
      series: [{ label: "time (s)", value: number }, limit("5 %"), limit("95 %"), limit("25 %"), limit("75 %"), { label: "median", stroke: blue, width: 2, value: number, points: { show: false } }],
      bands: [{ series: [2, 1], fill: blue + "33" }, { series: [4, 3], fill: blue + "33" }],
    }, data, at("predict-plot"));
    at("predict-plot").querySelector("canvas")?.setAttribute("aria-label", "Predicted position against time, with bands of 50 and 90 per cent");
  }
}
