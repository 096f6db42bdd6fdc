// @ts-check
// Table of all records of the folder: sorted, filtered, marked for jobs, and saved as CSV.
import { ask, at, attempt, make, shown } from "./requests.js";

/** @typedef {{symbol: string, unit: string, q05: number, median: number, q95: number}} Cell */
/** @typedef {{name: string, is_experiment: boolean, is_sheet: boolean, species: string|null, region: string|null, revision: string|null, effects?: string[], parameters?: Cell[], trust?: string, rmse_heldout_um?: number|null, noise_um?: number|null}} Row */
/** @typedef {{title: string, words: (row: Row) => string, sortedBy: (row: Row) => string|number|null, isNumber?: boolean}} Column */

/** @type {Record<string, string>} */
const TRUST = { trusted: "trusted", effective: "predictions only", untrusted: "not to be trusted" };

/** Median and 90 % interval, with as many digits as show the interval. @param {Cell} own */
function interval({ q05, median, q95 }) {
  const width = q95 - q05;
  const digits = width > 0 && median !== 0 ? Math.min(8, Math.max(3, 2 + Math.ceil(Math.log10(Math.abs(median) / width)))) : 3;
  return `${shown(median, digits)} (${shown(q05, digits)} to ${shown(q95, digits)})`;
}

export class Project {
  /** @param {(name: string) => void} onOpen @param {(kind: string, names: string[]) => Promise<void>} onJob */
  constructor(onOpen, onJob) {
    this.onOpen = onOpen;
    /** @type {Row[]} */ this.rows = [];
    /** @type {Set<string>} */ this.marked = new Set();
    /** Title of the column that sorts the table, and the direction. @type {[string, 1|-1]} */ this.order = ["record", 1];
    at("project-filter").addEventListener("input", () => this.draw());
    for (const kind of ["sample", "diagnose"]) at(`project-${kind}`).addEventListener("click", () => attempt(() => onJob(`${kind}-many`, [...this.marked])));
  }

  async refresh() {
    this.rows = (await ask("api/records")).filter((/** @type {Row} */ row) => !row.is_sheet);
    const names = new Set(this.rows.map((row) => row.name));
    this.marked.forEach((name) => names.has(name) || this.marked.delete(name));
    at("project").hidden = this.rows.length === 0 || at("start").hidden;
    at("start").classList.toggle("compact", this.rows.length > 0);
    this.draw();
  }

  /** @returns {Column[]} */
  columns() {
    const parameters = new Map(this.rows.flatMap((row) => row.parameters ?? []).map((own) => [own.symbol, own.unit]));
    const cell = (/** @type {Row} */ row, /** @type {string} */ symbol) => row.parameters?.find((own) => own.symbol === symbol);
    const text = (/** @type {string} */ title, /** @type {(row: Row) => string} */ words) => ({ title, words, sortedBy: (/** @type {Row} */ row) => (words(row) === "–" ? null : words(row)) });
    const number = (/** @type {string} */ title, /** @type {(row: Row) => number|null|undefined} */ value) => ({ title, words: (/** @type {Row} */ row) => shown(value(row)), sortedBy: (/** @type {Row} */ row) => value(row) ?? null, isNumber: true });
    return [
      text("record", (row) => row.name),
      text("species", (row) => row.species ?? "–"),
      text("region", (row) => row.region ?? "–"),
      text("model", (row) => (row.revision === null ? "–" : [row.revision, ...(row.effects ?? [])].join(" + "))),
      ...[...parameters].slice(0, 6).map(([symbol, unit]) => ({
        title: `${symbol} (${unit})`,
        words: (/** @type {Row} */ row) => {
          const own = cell(row, symbol);
          return own ? interval(own) : "–";
        },
        sortedBy: (/** @type {Row} */ row) => cell(row, symbol)?.median ?? null,
        isNumber: true,
      })),
      number("held-out error (µm)", (row) => row.rmse_heldout_um),
      number("noise (µm)", (row) => row.noise_um),
      text("verdict", (row) => (row.trust ? TRUST[row.trust] ?? row.trust : "–")),
    ];
  }

  draw() {
    // The table is made anew; what had the focus gets it again.
    const focused = document.activeElement instanceof HTMLElement && at("project-table").contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
    this.fill();
    if (focused) /** @type {HTMLElement|null} */ (at("project-table").querySelector(`[data-key="${CSS.escape(focused)}"]`))?.focus();
  }

  fill() {
    const columns = this.columns();
    const filter = /** @type {HTMLInputElement} */ (at("project-filter")).value.trim().toLowerCase();
    const [title, direction] = this.order;
    const key = (columns.find((own) => own.title === title) ?? columns[0]).sortedBy;
    const isShown = (/** @type {Row} */ row) => filter === "" || columns.some((own) => own.words(row).toLowerCase().includes(filter));
    const rows = this.rows.filter(isShown).sort((a, b) => {
      const [x, y] = [key(a), key(b)];
      // Records without a value come last in both directions.
      if (x === null || y === null) return Number(x === null) - Number(y === null);
      return direction * (typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y), undefined, { numeric: true }));
    });
    const all = make("input", { type: "checkbox", checked: rows.length > 0 && rows.every((row) => this.marked.has(row.name)) });
    all.dataset.key = "all";
    all.setAttribute("aria-label", "Mark all shown records");
    all.addEventListener("change", () => {
      rows.forEach((row) => (/** @type {HTMLInputElement} */ (all).checked ? this.marked.add(row.name) : this.marked.delete(row.name)));
      this.draw();
    });
    const sorter = (/** @type {Column} */ own) => {
      const isKey = own.title === title;
      const button = make("button", { type: "button", textContent: own.title + (isKey ? (direction > 0 ? " ▲" : " ▼") : "") });
      button.dataset.key = `head ${own.title}`;
      button.addEventListener("click", () => {
        this.order = [own.title, isKey && direction > 0 ? -1 : 1];
        this.draw();
      });
      const head = make("th", { scope: "col" }, [button]);
      head.setAttribute("aria-sort", isKey ? (direction > 0 ? "ascending" : "descending") : "none");
      return head;
    };
    at("project-head").replaceChildren(make("th", { scope: "col" }, [all]), ...columns.map(sorter));
    at("project-rows").replaceChildren(...rows.map((row) => {
      const mark = /** @type {HTMLInputElement} */ (make("input", { type: "checkbox", checked: this.marked.has(row.name) }));
      mark.dataset.key = `row ${row.name}`;
      mark.setAttribute("aria-label", `Mark ${row.name}`);
      mark.addEventListener("change", () => {
        if (mark.checked) this.marked.add(row.name);
        else this.marked.delete(row.name);
        this.count(rows.length);
      });
      const link = make("a", { href: `#${encodeURIComponent(row.name)}`, textContent: row.name });
      return make("tr", {}, [make("td", {}, [mark]), make("th", { scope: "row" }, [link]), ...columns.slice(1).map((own) => make("td", { className: own.isNumber ? "number" : "", textContent: own.words(row) }))]);
    }));
    this.count(rows.length);
    this.save(rows);
  }

  /** @param {number} nShown */
  count(nShown) {
    const marks = this.marked.size === 0 ? "" : `, ${this.marked.size} marked`;
    at("project-count").textContent = `${nShown} of ${this.rows.length} records${marks}`;
  }

  /** Offers the shown rows as a CSV file, with quantiles in columns of their own. @param {Row[]} rows */
  save(rows) {
    const symbols = [...new Map(this.rows.flatMap((row) => row.parameters ?? []).map((own) => [own.symbol, own.unit]))];
    const quote = (/** @type {unknown} */ value) => {
      // A text that begins like a formula must not become one in a spreadsheet.
      const text = value === null || value === undefined ? "" : typeof value === "string" && /^[=+\-@\t\r]/.test(value) ? `'${value}` : String(value);
      return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
    };
    const head = ["record", "species", "region", "revision", "effects", ...symbols.flatMap(([symbol, unit]) => ["q05", "median", "q95"].map((name) => `${symbol} ${name} (${unit})`)), "heldout_rmse_um", "noise_um", "trust"];
    const line = (/** @type {Row} */ row) => [row.name, row.species, row.region, row.revision, row.effects?.join(" "),
      ...symbols.flatMap(([symbol]) => {
        const own = row.parameters?.find((one) => one.symbol === symbol);
        return [own?.q05, own?.median, own?.q95];
      }), row.rmse_heldout_um, row.noise_um, row.trust];
    const text = [head, ...rows.map(line)].map((cells) => cells.map(quote).join(",")).join("\r\n") + "\r\n";
    const link = /** @type {HTMLAnchorElement} */ (at("project-csv"));
    if (link.href.startsWith("blob:")) URL.revokeObjectURL(link.href);
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  }
}
