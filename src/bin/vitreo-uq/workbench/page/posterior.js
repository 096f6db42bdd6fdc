// @ts-check
// Corner plot of the shown revision, or of two, with a choice of parameters. The server draws it, as `vitreo-uq corner` does.
import { ask, attempt, make, query } from "./requests.js";

/** Most parameters that are chosen at first: more make panels too small to read. */
const FIRST_PARAMETERS = 4;

export class PosteriorView {
  constructor() {
    /** Chosen parameters of each set of revisions. @type {Map<string, Set<string>>} */ this.chosen = new Map();
    this.asked = 0;
  }

  /** @param {string} item @param {string[]} revisions names of one or two revisions @param {{name: string, symbol: string}[]} parameters those of all revisions */
  element(item, revisions, parameters) {
    const key = JSON.stringify([item, revisions]);
    const names = this.chosen.get(key) ?? new Set(parameters.slice(0, FIRST_PARAMETERS).map((own) => own.name));
    this.chosen.set(key, names);
    const place = make("div", { className: "corner" });
    const redraw = () => attempt(() => this.draw(place, item, revisions, [...names]));
    const boxes = parameters.map(({ name, symbol }) => {
      const box = /** @type {HTMLInputElement} */ (make("input", { type: "checkbox", checked: names.has(name), autocomplete: "off" }));
      box.addEventListener("change", () => {
        if (box.checked) names.add(name);
        else if (names.size > 1) names.delete(name);
        box.checked = names.has(name);
        redraw();
      });
      return make("label", {}, [box, ` ${symbol}`]);
    });
    redraw();
    return make("div", {}, [
      make("p", { className: "tools" }, ["Parameters of the corner plot:", ...boxes]),
      make("p", { className: "lead", textContent: "Dashed: prior density. Contours enclose 50 and 90 % of the draws. Choose a second revision beside the first to compare two posteriors." }),
      place,
    ]);
  }

  /** @param {HTMLElement} place @param {string} item @param {string[]} revisions @param {string[]} parameters */
  async draw(place, item, revisions, parameters) {
    const number = ++this.asked;
    const { svg } = await ask(`api/corner?${query({ item, revisions: revisions.join(","), parameters: parameters.join(",") })}`);
    if (number === this.asked) place.innerHTML = svg;
  }
}
