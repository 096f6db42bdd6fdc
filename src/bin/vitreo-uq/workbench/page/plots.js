// @ts-check
// Plots with a common time axis: positions, residuals and force.

/** @typedef {{time_s: number[], force_un: number[], position_um: (number|null)[], rows: [number, number],
 *   predicted?: Predicted, compared?: Predicted}} Rows */
/** @typedef {{median_um: number[], q05_um: number[], q95_um: number[], residual_um: (number|null)[]}} Predicted */
/** @typedef {{time_s: number[], tried_um: number[], tried_residual_um: (number|null)[], rmse_fitted_um: number|null, rmse_heldout_um: number|null}} Tried */

/** @type {any} */
const uPlot = /** @type {any} */ (globalThis).uPlot;
const GROUP = "time";
/** A drag selects times, or values while the Shift key is held down. @param {any} plot @param {any} _ @param {(event: MouseEvent) => null} handler */
const chooseAxis = (plot, _, handler) => (/** @type {MouseEvent} */ event) => {
  [plot.cursor.drag.x, plot.cursor.drag.y] = [!event.shiftKey, event.shiftKey];
  return handler(event);
};
/** Colour of a second model beside the first. */
const SECOND = "#a45bd6";

/** Height of a plot in px: a share of the window's height within limits. @param {number} share @param {number} least @param {number} most */
const heightOf = (share, least, most) => Math.round(Math.min(most, Math.max(least, share * innerHeight)));

/** Draws each column of pixels as one vertical bar from its lowest to its highest value: points of a record with several rows in a column would look like waves.
 * @param {any} plot @param {number} place index of the series @param {number} first @param {number} last */
function barsOfColumns(plot, place, first, last) {
  const [times, values] = [plot.data[0], plot.data[place]];
  const stroke = new Path2D();
  let [column, low, high] = [NaN, Infinity, -Infinity];
  const end = () => {
    if (low > high) return;
    stroke.moveTo(column, Math.min(low, high - 2));
    stroke.lineTo(column, high);
  };
  for (let row = first; row <= last; row++) {
    if (values[row] === null || values[row] === undefined) continue;
    const x = Math.round(plot.valToPos(times[row], "x", true)), y = plot.valToPos(values[row], "y", true);
    if (x !== column) {
      end();
      [column, low, high] = [x, Infinity, -Infinity];
    }
    [low, high] = [Math.min(low, y), Math.max(high, y)];
  }
  end();
  return { stroke, fill: null, clip: null, flags: 2 };
}

/** @param {string} name */
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Plots {
  /** @param {(from: number|null, to: number|null) => void} onWindow called with the time range that the user selects */
  constructor(onWindow) {
    this.onWindow = onWindow;
    /** @type {Rows|null} */ this.rows = null;
    /** @type {Tried|null} */ this.tried = null;
    /** @type {{from: number, to: number}[]} */ this.marks = [];
    /** @type {{from: number, to: number}[]} */ this.heldOut = [];
    /** @type {[number, number]|null} */ this.window = null;
    /** @type {any[]} */ this.plots = [];
    /** @type {{time_s: number[], left_um: (number|null)[], change_um: (number|null)[], claimed_um: (number|null)[]}|null} */ this.fingerprint = null;
    /** @type {string} */ this.kind = "";
    /** Labels of the axes of measurement, residual and command, and the unit of the measurement. */ this.axes = ["position (µm)", "residual (µm)", "force (µN)", "µm"];
    this.isLogTime = false;
    /** Range of values of plots that the user has zoomed, by the place of the plot. @type {Map<string, [number, number]>} */ this.zoomed = new Map();
    addEventListener("resize", () => this.resize());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.rebuild());
  }

  /** @param {string[]} axes labels of the axes of measurement, residual and command, and the unit of the measurement */
  setAxes(axes) {
    if (axes.join() === this.axes.join()) return;
    this.axes = axes;
    this.rebuild();
  }

  /** @param {{from: number, to: number}[]} heldOut time ranges of held-out cycles */
  setHeldOut(heldOut) {
    this.heldOut = heldOut;
  }

  /** Shows the whole record, and all values. */
  showWhole() {
    this.zoomed.clear();
    this.onWindow(null, null);
  }

  /** Removes what is drawn. */
  clear() {
    this.plots.forEach((plot) => plot.destroy());
    this.plots = [];
    this.zoomed.clear();
    [this.rows, this.tried, this.fingerprint, this.marks] = [null, null, null, []];
  }

  /** @param {boolean} isLogTime whether the axis of time is logarithmic */
  setLogTime(isLogTime) {
    this.isLogTime = isLogTime;
    this.rebuild();
  }

  /** @param {Rows} rows @param {[number, number]|null} window */
  show(rows, window) {
    this.rows = rows;
    this.window = window;
    const kind = (rows.predicted ? "predicted" : "record") + (rows.compared ? " compared" : "") + (rows.time_s.length > 2 * this.width() ? " in columns" : "");
    // Without a model there are no residuals.
    /** @type {HTMLElement} */ (document.getElementById("plot-residual")).hidden = !rows.predicted;
    if (kind !== this.kind || this.plots.length === 0) {
      this.kind = kind;
      this.rebuild();
    } else {
      this.refill();
    }
  }

  /** Draws the residuals, the part that an effect would explain, and the part that the claimed effect explains. @param {{time_s: number[], left_um: (number|null)[], change_um: (number|null)[], claimed_um: (number|null)[]}} own */
  showFingerprint(own) {
    this.fingerprint = own;
    const plot = this.plots[3];
    if (plot && this.rows) plot.setData([own.time_s, own.left_um, own.change_um, own.claimed_um], false), this.rescale(plot);
  }

  /** @param {Tried|null} tried */
  showTried(tried) {
    this.tried = tried;
    if (this.plots.length === 0 || !this.rows) return;
    this.plots[0].setData(this.positions(), false);
    this.plots[1].setData(this.residuals(), false);
    this.plots.slice(0, 2).forEach((plot) => this.rescale(plot));
  }

  /** The trial, unless it belongs to another time range. @param {Rows} rows @returns {Tried|null} */
  triedOf(rows) {
    const { tried } = this;
    return tried && tried.time_s.length === rows.time_s.length && tried.time_s[0] === rows.time_s[0] ? tried : null;
  }

  residuals() {
    const rows = /** @type {Rows} */ (this.rows);
    const none = rows.time_s.map(() => null);
    return [rows.time_s, rows.predicted?.residual_um ?? none, rows.compared?.residual_um ?? none, this.triedOf(rows)?.tried_residual_um ?? none];
  }

  /** @param {{from: number, to: number}[]} marks time ranges to shade */
  mark(marks) {
    this.marks = marks;
    this.plots.forEach((plot) => plot.redraw(false));
  }

  positions() {
    const rows = /** @type {Rows} */ (this.rows);
    const own = rows.predicted;
    const none = rows.time_s.map(() => null);
    const tried = this.triedOf(rows)?.tried_um ?? none, compared = rows.compared?.median_um ?? none;
    return own
      ? [rows.time_s, own.q95_um, own.q05_um, own.median_um, compared, rows.position_um, tried]
      : [rows.time_s, none, none, none, compared, rows.position_um, tried];
  }

  refill() {
    const rows = /** @type {Rows} */ (this.rows);
    const data = [
      this.positions(),
      this.residuals(),
      [rows.time_s, rows.force_un],
    ];
    this.plots.forEach((plot, place) => {
      if (data[place]) plot.setData(data[place], false);
      this.rescale(plot);
    });
  }

  /** @param {any} plot */
  rescale(plot) {
    const times = /** @type {Rows} */ (this.rows).time_s;
    let [min, max] = this.window ?? [times[0], times[times.length - 1]];
    // A logarithmic axis begins at the first time after 0.
    if (this.isLogTime && min <= 0) min = times.find((time) => time > 0) ?? max / 1000;
    plot.batch(() => {
      plot.setScale("x", { min, max });
    });
  }

  /** Points to ask for: in each column of pixels the first row, and the lowest and highest of three series. */
  points() {
    return 7 * this.width();
  }

  width() {
    return /** @type {HTMLElement} */ (document.getElementById("plot-position")).clientWidth || 600;
  }

  resize() {
    const heights = this.heights();
    this.plots.forEach((plot, place) => plot.setSize({ width: this.width(), height: heights[place] }));
  }

  /** Heights of the plots in px: together with the sliders they fit into one window. */
  heights() {
    return [heightOf(0.3, 180, 900), heightOf(0.15, 100, 420), heightOf(0.13, 104, 260), heightOf(0.18, 130, 400)];
  }

  rebuild() {
    this.plots.forEach((plot) => plot.destroy());
    this.plots = [];
    if (!this.rows) return;
    const [ink, line, blue, orange, green] = ["--ink", "--line", "--link", "--wrong", "--sound"].map(colour);
    const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 } };
    const number = (/** @type {any} */ _, /** @type {number|null} */ value) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(5))));
    const options = (/** @type {number} */ height, /** @type {string} */ label, /** @type {any[]} */ series, /** @type {any[]} */ bands, /** @type {boolean} */ isLast) => ({
      width: this.width(),
      height,
      cursor: { sync: { key: GROUP, setSeries: false }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => this.showWhole(), mousedown: chooseAxis } },
      scales: { x: { time: false, distr: this.isLogTime ? 3 : 1 }, y: { range: (/** @type {any} */ plot, /** @type {number|null} */ min, /** @type {number|null} */ max) => this.zoomed.get(plot.root.parentElement.id) ?? (min === null ? [0, 1] : uPlot.rangeNum(min, max, 0.1, true)) } },
      legend: { show: bands.length > 0 },
      axes: [{ ...axis, label: isLast ? "time (s)" : undefined, size: 34, labelSize: 20 }, { ...axis, label, size: 70, labelSize: 20, space: 22 }],
      series: [{ label: "time (s)", value: number }, ...series.map((own) => ({ value: number, spanGaps: false, ...own }))],
      bands,
      hooks: {
        setSelect: [(/** @type {any} */ plot) => {
          const { left, top, width, height } = plot.select;
          if (width < 4 || height < 4) return;
          const [from, to] = [left, left + width].map((place) => plot.posToVal(place, "x"));
          const values = [top + height, top].map((place) => plot.posToVal(place, "y"));
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          if (!plot.cursor.drag.y) return this.onWindow(from, to);
          this.zoomed.set(plot.root.parentElement.id, /** @type {[number, number]} */ (values));
          plot.setData(plot.data, false);
          this.rescale(plot);
        }],
        drawClear: [(/** @type {any} */ plot) => this.shade(plot)],
      },
    });
    const shown = this.kind.startsWith("predicted");
    const isCompared = this.kind.includes("compared"), isInColumns = this.kind.endsWith("in columns");
    /** Measured values: dots, or bars where several rows share a column of pixels. */
    const dots = (/** @type {string} */ tint) => (isInColumns ? { stroke: tint, width: 1, points: { show: false }, paths: barsOfColumns } : { width: 0, points: { show: true, size: 3, fill: tint }, paths: () => null, stroke: tint });
    const [high, middle, low, last] = this.heights();
    const put = (/** @type {string} */ id, /** @type {any} */ own, /** @type {string} */ words) => {
      const place = /** @type {HTMLElement} */ (document.getElementById(id));
      place.setAttribute("role", "img");
      place.setAttribute("aria-label", words);
      this.plots.push(new uPlot(own, [[0], ...own.series.slice(1).map(() => [0])], place));
    };
    put("plot-position", options(high, this.axes[0], [
      { label: "95 %", show: shown, stroke: blue, width: 0.5 },
      { label: "5 %", show: shown, stroke: blue, width: 0.5 },
      { label: "model", show: shown, stroke: blue, width: 2 },
      { label: "beside", show: isCompared, stroke: SECOND, width: 2 },
      { label: "measured", ...dots(ink) },
      { label: "trial", stroke: orange, width: 2, dash: [6, 4] },
    ], [{ series: [1, 2], fill: blue + "33" }], false), `Measured ${this.axes[0]} against time, over the model's median and its band from 5 to 95 per cent`);
    put("plot-residual", options(middle, this.axes[1], [{ label: "residual", ...dots(ink) }, { label: "beside", ...dots(SECOND) }, { label: "of the trial", ...dots(orange) }], [], false),
      `${this.axes[1]} against time`);
    put("plot-force", options(low, this.axes[2], [{ label: this.axes[2], stroke: green, width: 1.5, paths: uPlot.paths.stepped({ align: 1 }) }], [], true), `Commanded ${this.axes[2]} against time`);
    put("plot-fingerprint", options(last, this.axes[1], [{ label: "residual", stroke: ink, width: 0, points: { show: true, size: 3, fill: ink }, paths: () => null }, { label: "explained by the effect", stroke: orange, width: 2.5 }, { label: "explained by the claimed effect", stroke: SECOND, width: 1.5, dash: [6, 4] }], [], true), `${this.axes[1]}, and the parts that the selected and the claimed effect would explain, against time`);
    if (this.fingerprint) this.showFingerprint(this.fingerprint);
    this.refill();
  }

  /** @param {any} plot */
  shade(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const fill = (/** @type {{from: number, to: number}[]} */ stretches, /** @type {string} */ tint) => {
      ctx.fillStyle = tint;
      for (const { from, to } of stretches) {
        const left = plot.valToPos(from, "x", true), right = plot.valToPos(to, "x", true);
        ctx.fillRect(left, bbox.top, Math.max(2, right - left), bbox.height);
      }
    };
    fill(this.heldOut, colour("--muted") + "1c");
    fill(this.marks, colour("--doubtful") + "40");
    ctx.restore();
  }
}
