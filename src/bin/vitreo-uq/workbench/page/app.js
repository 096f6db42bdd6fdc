// @ts-check
// Workbench page: shows the documents that commands write, and starts commands. It computes only the layout of drawings.
import { Plots } from "./plots.js";
import { PosteriorView } from "./posterior.js";
import { PredictionView } from "./predict.js";
import { Project } from "./project.js";
import { ask, at, attempt, fault, listen, make, query, send, shown } from "./requests.js";

/** @typedef {{name: string, experiment: string|null, study: string, revisions: string[], figures: string[]}} Item */
/** @typedef {{item: string, kind: string, standing: string, words: string, at: number, commands: string[][], began_s: number, progress: [number, number]|null}} Job */
/** @typedef {{name: string, posterior: any, comparison: any, diagnosis: any, learned: any, extension: any}} Revision */
/** @typedef {{item: Item, record: any, noise_um: number|null, cycles: {cycle: number, from_s: number, to_s: number, serves: string, chosen: string}[],
 *   left_out_s: [number, number][], is_changed: boolean, revisions: Revision[], ladder: any, parts: Record<string, string>, axes: string[]}} Study */
/** @typedef {{leftOut: [number, number][], serves: string[]}} Draft */
/** @typedef {{name: string, symbol: string, unit: string, value: number, low: number, high: number, null_value: number|null, is_logarithmic: boolean}} Knob */

const state = {
  /** @type {Item[]} */ items: [],
  /** @type {string|null} */ item: null,
  /** @type {string|null} */ revision: null,
  /** Revision that is shown beside the first. @type {string|null} */ compared: null,
  /** @type {Study|null} */ study: null,
  /** @type {[number, number]|null} */ window: null,
  /** @type {Job|null} */ job: null,
  /** @type {Knob[]} */ knobs: [],
  /** @type {string} */ effect: "",
  /** @type {Record<string, number>} */ values: {},
  /** Choice of rows that is not applied yet. Changes of the folder must not discard it. @type {Draft|null} */ draft: null,
  folder: "",
};

// ---- Dropped tables ----

/** @param {File} file */
async function upload(file) {
  if (file.size > 256 * 2 ** 20) throw new Error(`${file.name} is larger than 256 MiB. Run \`vitreo-uq init TABLE\` in a terminal, which reads up to 1 GiB.`);
  const { upload } = await ask(`api/table?${query({ name: file.name })}`, { method: "POST", body: file });
  await describe({ upload, file: file.name, answers: {} });
}

/** Optional information: name of the field and its label. */
const OPTIONAL = [["noise", "Noise standard deviation, if known: of a position in µm, a force in µN, a strain in %, a stress in Pa"], ["species", "Species, if groups are to be compared"], ["region", "Region of the eye, if groups are to be compared"]];

/** @param {{upload: string, file: string, answers: Record<string, string>, noise_um?: number|null, groups?: (string|null)[], columns?: (string|null)[]}} described */
async function describe(described) {
  const form = at("answers");
  // The questions shown belong to earlier roles of columns until the new ones arrive.
  form.inert = true;
  const found = await send("api/init", described).finally(() => (form.inert = false));
  if (!found.questions) {
    at("questions").hidden = true;
    await refreshItems();
    return open(found.item);
  }
  /** @type {(label: Element) => [string, HTMLInputElement|null]} */
  const field = (label) => [label.firstChild?.textContent ?? "", label.querySelector("input, select")];
  // Answers that are typed already stay if the roles of columns change.
  const typed = new Map(form.dataset.upload === described.upload ? [...form.querySelectorAll("label")].map(field) : []);
  form.dataset.upload = described.upload;
  form.replaceChildren(
    make("p", { textContent: `${described.file}: the table gives all other information.` }),
    ...(found.preview ? [previewOf(found.preview, described)] : []),
    ...found.questions.map((/** @type {any} */ question, /** @type {number} */ place) => {
      const field = question.choices.length > 0
        ? make("select", { name: String(place) }, question.choices.map((/** @type {string} */ choice) => make("option", { value: choice, textContent: choice, selected: choice === question.proposal })))
        : make("input", { name: String(place), value: question.proposal ?? "", required: true, autocomplete: "off" });
      return make("label", {}, [question.text[0].toUpperCase() + question.text.slice(1), field]);
    }),
    ...OPTIONAL.map(([name, words]) => make("label", {}, [words, make("input", { name, autocomplete: "off" })])),
    make("p", {}, [make("button", { className: "main", textContent: "Continue" })]),
  );
  form.querySelectorAll("label").forEach((label) => {
    const [words, input] = field(label);
    const before = typed.get(words)?.value;
    if (input && before) input.value = before;
  });
  form.onsubmit = (event) => {
    event.preventDefault();
    const answers = { ...described.answers };
    found.questions.forEach((/** @type {any} */ question, /** @type {number} */ place) => {
      answers[question.text] = /** @type {HTMLInputElement} */ (form.querySelector(`[name="${place}"]`)).value;
    });
    const [noise, species, region] = OPTIONAL.map(([name]) => /** @type {HTMLInputElement} */ (form.querySelector(`[name="${name}"]`)).value.trim());
    const noise_um = noise ? Number(noise.replace(",", ".")) : null;
    if (Number.isNaN(noise_um)) return fault(new Error(`\`${noise}\` is not a number.`));
    attempt(() => describe({ ...described, answers, noise_um, groups: [species || null, region || null] }));
  };
  at("questions").hidden = false;
  at("start").hidden = true;
  /** @type {HTMLElement|null} */ (form.querySelector("label select, label input"))?.focus();
}

/** Roles of columns, in the order in which the server takes them. */
const ROLES = ["time", "force", "position", "cycle"];

/** First rows of the table. The user may give each column a role; columns without one are recognised by their names and values.
 * @param {{names: string[], rows: string[][], said: string}} preview @param {any} described */
function previewOf(preview, described) {
  const columns = described.columns ?? ROLES.map(() => null);
  const head = preview.names.map((name, place) => {
    const number = String(place + 1);
    const select = make("select", {}, ["as recognised", ...ROLES].map((role) => make("option", { value: role, textContent: role, selected: columns[ROLES.indexOf(role)] === number })));
    select.setAttribute("aria-label", `Role of column ${name}`);
    select.addEventListener("change", () => attempt(() => {
      const role = ROLES.indexOf(/** @type {HTMLSelectElement} */ (select).value);
      const chosen = columns.map((/** @type {string|null} */ own, /** @type {number} */ at) => (at === role ? number : own === number ? null : own));
      return describe({ ...described, columns: chosen });
    }));
    return make("th", { scope: "col" }, [name, make("br"), select]);
  });
  const rows = preview.rows.map((cells) => make("tr", {}, cells.map((cell) => make("td", { textContent: cell }))));
  const table = make("table", {}, [make("thead", {}, [make("tr", {}, head)]), make("tbody", {}, rows)]);
  return make("div", { className: "scroll preview", tabIndex: 0 }, [table, make("p", { className: "lead", textContent: `${preview.said}.` })]);
}

// ---- Items ----

async function refreshItems() {
  const { home, items } = await ask("api/items");
  if (state.item === null) await project.refresh();
  state.items = items;
  at("home").textContent = home;
  const list = at("items");
  list.replaceChildren(make("option", { value: "", textContent: "choose …" }), ...items.map((/** @type {Item} */ item) =>
    make("option", { value: item.name, textContent: item.revisions.length > 0 ? `${item.name} (${item.revisions.length} ${item.revisions.length === 1 ? "model" : "models"})` : item.name, selected: item.name === state.item })));
}

/** Item and revision that the address of the page names. @returns {[string|null, string|null]} */
function addressed() {
  try {
    const [name, revision] = location.hash.slice(1).split("&").map(decodeURIComponent);
    return [name || null, revision ?? null];
  } catch {
    // An address that was written by hand.
    return [null, null];
  }
}

/** Makes the address name what is open. */
function setAddress() {
  const names = [state.item, state.item === null ? null : state.revision].filter((own) => own !== null);
  const address = `#${names.map(encodeURIComponent).join("&")}`;
  if (location.hash !== address && location.hash + "#" !== address) history.pushState(null, "", address);
  document.title = state.item === null ? "vitreo-uq workbench" : `${state.item} – vitreo-uq`;
}

/** Opens an item, or the table of all. The address follows, so that the Back button leads to what was open before.
 * @param {string|null} name @param {string|null} [revision] */
async function open(name, revision = null) {
  state.item = name;
  state.revision = revision;
  state.compared = null;
  state.window = null;
  state.draft = null;
  state.effect = "";
  setAddress();
  at("start").hidden = name !== null;
  at("compare").hidden = name !== null || state.items.filter((item) => item.experiment !== null).length < 2;
  at("item").hidden = true;
  at("sheet").hidden = true;
  at("questions").hidden = true;
  state.study = null;
  state.values = {};
  at("tried").textContent = "";
  at("project").hidden = true;
  at("description").removeAttribute("open");
  at("cell").textContent = "";
  plots.clear();
  scrollTo(0, 0);
  if (name !== null) await refresh();
  await refreshItems();
}

let asked = 0;
async function refresh() {
  const [item, number] = [state.item, ++asked];
  if (item === null) return;
  /** @type {Study} */
  const study = await ask(`api/study?${query({ item, revision: state.revision })}`);
  // Another record may have been opened meanwhile.
  if (number !== asked || item !== state.item) return;
  if (study.item.figures.length > 0) return showSheet(study.item);
  state.study = study;
  const names = study.item.revisions;
  if (state.revision === null || !names.includes(state.revision)) state.revision = names[names.length - 1] ?? null;
  // Later revisions are fitted to more cycles than the first, for which the user has chosen them.
  study.cycles.forEach((own) => (own.chosen = own.serves));
  const heldout = study.revisions.find((own) => own.name === state.revision)?.posterior?.heldout;
  if (heldout) study.cycles.forEach((own) => (own.serves = heldout.cycles.includes(own.cycle) ? "held out" : heldout.fitted_cycles.includes(own.cycle) ? "fitted" : "unused"));
  at("item").hidden = false;
  plots.setHeldOut(study.cycles.filter((own) => own.serves === "held out").map(({ from_s, to_s }) => ({ from: from_s, to: to_s })));
  showStudy(study);
  const shownRevision = study.revisions.find((own) => own.name === state.revision);
  predictionView.show(study.item.name, state.revision, JSON.stringify(shownRevision?.posterior?.parameters ?? null)).catch(fault);
  await Promise.all([refreshRows(), refreshKnobs()]);
}

/** Shows the results of `groups` or `shapes`. @param {Item} item */
function showSheet(item) {
  at("sheet").hidden = false;
  at("sheet-heading").textContent = item.name;
  const path = (/** @type {string} */ path) => `file?${query({ item: item.name, path, of: state.folder })}`;
  at("sheet-body").replaceChildren(
    make("p", {}, [make("a", { href: path("report.html"), textContent: "All results on one page", target: "_blank" })]),
    ...item.figures.map((name) => make("p", {}, [make("img", { src: path(name), loading: "lazy", alt: name })])),
  );
}

let askedRows = 0;
async function refreshRows() {
  if (state.item === null) return;
  const [number, window] = [++askedRows, state.window];
  const points = plots.points();
  const rows = await ask(`api/rows?${query({ item: state.item, revision: state.revision, compared: state.compared, from_s: window?.[0], to_s: window?.[1], points, is_logarithmic: String(plots.isLogTime) })}`);
  if (number !== askedRows) return;
  const [all, inside] = rows.rows;
  at("decimated").textContent = rows.time_s.length < inside
    ? `${rows.time_s.length} of ${inside} rows are drawn: the lowest and highest of each pixel column${inside < all ? `; the record has ${all}` : ""}`
    : "";
  plots.show(rows, window);
  if (Object.keys(state.values).length > 0 || state.effect) tryNow();
}

// ---- Words of the field ----

/** Meanings of the glossary by term in lower case. @type {Map<string, string>} */
let meanings = new Map();
async function readGlossary() {
  const text = await (await fetch("glossary.md")).text();
  const rows = text.split("\n").map((line) => line.split("|").map((cell) => cell.trim())).filter((cells) => cells.length >= 4 && cells[1] && !cells[1].startsWith("-"));
  meanings = new Map(rows.map((cells) => [cells[1].toLowerCase(), cells[2].replace(/\*/g, "")]));
}

/** Gives headings of tables whose words the glossary explains a tooltip. */
function explain() {
  document.querySelectorAll("main th, main summary, main h2").forEach((own) => {
    const element = /** @type {HTMLElement} */ (own);
    const words = (element.textContent ?? "").toLowerCase().replace(/\s*\(.*\)/, "").trim();
    const meaning = meanings.get(words) ?? meanings.get(words.replace(/s$/, ""));
    if (meaning && !element.title) element.title = meaning;
  });
}

// ---- Views ----

/** @param {Study} study */
function showStudy(study) {
  const { revisions, record } = study;
  const revision = revisions.find((own) => own.name === state.revision);
  at("item-heading").textContent = record.experiment;
  plots.setAxes(study.axes);
  at("revision").replaceChildren(...(revisions.length > 0 ? revisions : [{ name: "none yet" }]).map(({ name }) =>
    make("option", { value: name, textContent: titleOf(study, name), selected: name === state.revision })));
  const others = revisions.filter(({ name }) => name !== state.revision);
  if (!others.some(({ name }) => name === state.compared)) state.compared = null;
  at("compared-label").hidden = others.length === 0;
  at("compared").replaceChildren(make("option", { value: "", textContent: "none" }), ...others.map(({ name }) => make("option", { value: name, textContent: titleOf(study, name), selected: name === state.compared })));
  at("window").replaceChildren(make("option", { value: "", textContent: "the whole record" }), ...study.cycles.slice(0, 200).map(({ cycle, from_s, to_s, serves }) =>
    make("option", { value: `${from_s} ${to_s}`, textContent: `cycle ${cycle} (${serves})`, selected: state.window?.[0] === from_s && state.window?.[1] === to_s })));
  at("verdict").innerHTML = study.parts.verdict ?? "";
  at("parameters").innerHTML = study.parts.parameters ?? "";
  showNext(study, revision);
  showLadder(study);
  showMap(study, revision);
  showSuspects(study, revision);
  const parts = /** @type {[string, string][]} */ ([["posterior", "Posterior"], ["errors", "Sources of uncertainty"], ["fails", "Misfits: all tests"], ["missing", "Missing effects: figures and noise"], ["measured", "Measurement"], ["warned", "Warnings"], ["origin", "Commands that reproduce the study"]]);
  const opened = new Set([...at("parts").querySelectorAll("details[open]")].map((own) => /** @type {HTMLElement} */ (own).dataset.part));
  at("parts").replaceChildren(...parts.filter(([id]) => study.parts[id]).map(([id, heading]) => {
    const details = make("details", { open: opened.has(id) }, [make("summary", { textContent: heading })]);
    details.dataset.part = id;
    details.insertAdjacentHTML("beforeend", study.parts[id]);
    if (id === "posterior") showPosterior(study, details);
    return details;
  }));
  if (revisions.length === 0) {
    at("parts").replaceChildren(make("section", {}, [make("h2", { textContent: "Record as read" }), make("ul", {}, record.understood.sentences.map((/** @type {string} */ text) => make("li", { textContent: text }))),
      ...record.contradictions.map((/** @type {any} */ own) => make("p", { className: "fatal", textContent: `${own.text}. What to do: ${own.advice}.` }))]));
  }
  showFiles(study);
  showChoice(study);
  explain();
}

/** The corner plot with a choice of parameters takes the place of the report's, as soon as it is in view. @param {Study} study @param {HTMLElement} details */
function showPosterior(study, details) {
  const names = /** @type {string[]} */ ([state.revision, state.compared].filter((name) => name !== null));
  const all = names.flatMap((name) => study.revisions.find((own) => own.name === name)?.posterior?.parameters ?? []);
  const parameters = all.filter((own, place) => all.findIndex((other) => other.name === own.name) === place);
  const show = () => {
    if (!details.hasAttribute("open") || details.querySelector(".corner")) return;
    details.querySelector("summary")?.after(posteriorView.element(study.item.name, names, parameters));
  };
  details.addEventListener("toggle", show);
  show();
}
const posteriorView = new PosteriorView();
const predictionView = new PredictionView();

/** Shows the choice of fitted, held-out and unused cycles, and of omitted time ranges. @param {Study} study */
function showChoice(study) {
  at("choice").hidden = study.item.experiment === null;
  /** @type {Draft} */
  const draft = state.draft?.serves.length === study.cycles.length ? state.draft : { leftOut: [...study.left_out_s], serves: study.cycles.map((own) => own.chosen) };
  const { leftOut } = draft;
  const keep = () => (state.draft = draft);
  const serves = study.cycles.map((own, place) => {
    const select = make("select", {}, ["fitted", "held out", "unused"].map((word) => make("option", { value: word, textContent: word, selected: word === draft.serves[place] })));
    select.addEventListener("change", () => {
      draft.serves[place] = /** @type {HTMLSelectElement} */ (select).value;
      keep();
    });
    return { cycle: own.cycle, label: make("label", {}, [`cycle ${own.cycle} `, select]) };
  });
  const list = make("ul");
  const showList = () => list.replaceChildren(...leftOut.map((own, place) => {
    const button = make("button", { type: "button", textContent: "use again" });
    button.addEventListener("click", () => {
      leftOut.splice(place, 1);
      keep();
      showList();
    });
    return make("li", {}, [`left out: ${shown(own[0], 5)} to ${shown(own[1], 5)} s `, button]);
  }));
  const leave = make("button", { type: "button", textContent: "Leave out the shown time range" });
  leave.addEventListener("click", () => {
    if (!state.window) return fault(new Error("First drag over a plot to select the time range to leave out."));
    leftOut.push(/** @type {[number, number]} */ (state.window.map((time) => Number(time.toPrecision(7)))));
    keep();
    showList();
  });
  showList();
  const apply = make("button", { className: "main", textContent: "Use these rows" });
  const form = at("choices");
  form.replaceChildren(
    make("p", { className: "tools" }, serves.slice(0, 60).map((own) => own.label)),
    list,
    make("p", { className: "tools" }, [leave, apply]),
  );
  form.onsubmit = (event) => {
    event.preventDefault();
    const those = (/** @type {string} */ word) => serves.filter((_, place) => draft.serves[place] === word).map((own) => own.cycle);
    attempt(async () => {
      if (study.item.revisions.length > 0 && !confirm("The models of this record belong to its present choice of rows. They are not shown with another choice, and the next fit replaces them; with the present choice set again, they come back. Use the new choice?")) return;
      await send("api/choice", { item: study.item.name, fitted: those("fitted"), heldout: those("held out"), left_out_s: leftOut });
      state.draft = null;
      state.revision = null;
      state.window = null;
      await refresh();
    });
  };
}

/** @param {Study} study @param {string} name */
function titleOf(study, name) {
  const model = study.revisions.find((own) => own.name === name)?.posterior?.model;
  return model ? [`${name}: ${model.base}`, ...model.effects].join(" + ") : name;
}

/** @param {string} text @param {any} wish @param {boolean} [isMain] */
const action = (text, wish, isMain = false) => {
  const button = make("button", { type: "button", textContent: text, className: isMain ? "main" : "", disabled: state.job?.standing === "running" });
  button.dataset.action = wish.kind;
  button.addEventListener("click", () => attempt(async () => showJob(await send("api/job", { item: state.item, revision: state.revision, ...wish }))));
  return button;
};

/** Steps of the loop from a record to a model without misfit. */
const LOOP = ["Record", "Fit", "Where it fails", "Missing effect", "Add and fit again"];

/** Marks the step of the loop that comes next. @param {Study} study @param {Revision|undefined} revision */
function showLoop(study, revision) {
  const isLast = study.revisions.length > 1 && revision === study.revisions[study.revisions.length - 1];
  const present = !revision ? 1 : !revision.comparison ? 2 : !revision.diagnosis ? 3 : revision.diagnosis.verdict.effects?.length > 0 || revision.learned?.formula ? 4 : isLast ? -1 : 3;
  at("loop").replaceChildren(...LOOP.map((words, place) => {
    const step = make("li", { textContent: words });
    if (place === present) step.setAttribute("aria-current", "step");
    return step;
  }));
}

/** Shows the next step. @param {Study} study @param {Revision|undefined} revision */
function showNext(study, revision) {
  showLoop(study, revision);
  const lines = [];
  const paragraph = (/** @type {(Node|string)[]} */ ...children) => lines.push(make("p", {}, children));
  if (!revision) {
    if (study.is_changed) paragraph("The record has changed since its models were fitted. A new fit replaces them.");
    paragraph("Fit the first model to the record, check it with full finite elements, and test its residuals.");
    paragraph(action("Fit the model", { kind: "sample" }, true));
  } else {
    const { diagnosis, learned } = revision;
    const effects = diagnosis?.verdict.effects ?? [];
    if (!diagnosis) {
      paragraph("Find out which physical effect is missing. Each candidate effect is refitted and tested on the last held-out cycle.");
      paragraph(action("Find missing effects", { kind: "diagnose" }, true));
    } else if (effects.length > 0) {
      paragraph("Add it, fit again, and compare the error on the last held-out cycle.");
      paragraph(action(`Add ${effects.join(" and ")}`, { kind: "extend", with: effects }, true));
    } else if (diagnosis.verdict.kind === "unexplained" && !learned) {
      paragraph("No effect of the library explains the remaining misfit. Learn a correction of the law from the data.");
      paragraph(action("Learn from the data", { kind: "learn" }, true));
    } else if (learned && !learned.formula) {
      paragraph(learned.verdict.sentence);
      if (learned.verdict.kind === "nothing") paragraph("Nothing was learnt. A record with other force levels, longer holds or more cycles may show more.");
    } else if (learned?.formula) {
      paragraph(learned.verdict.sentence);
      paragraph(action("Add the learnt formula", { kind: "adopt" }, true));
    } else {
      paragraph(diagnosis.verdict.sentence);
    }
    const others = [];
    if (diagnosis) others.push(action("Diagnose again", { kind: "diagnose" }));
    if (!learned && diagnosis && (effects.length > 0 || diagnosis.verdict.kind !== "unexplained")) others.push(action("Learn from the data", { kind: "learn" }));
    if (!revision.comparison) others.push(action("Test the residuals", { kind: "compare" }));
    if (others.length > 0) lines.push(make("p", { className: "tools" }, others));
  }
  at("next").replaceChildren(...lines);
}

/** Shows the error of each revision on the last held-out cycle, from the ladder or another document of the revision. Without such a document it shows the error on all held-out cycles. @param {Study} study */
function showLadder(study) {
  const isWhole = study.ladder?.revisions.length === study.revisions.length;
  const extending = (/** @type {Revision} */ { name }) => study.revisions.find((other) => other.extension?.from === name)?.extension;
  const onLast = study.revisions.map((own, place) =>
    isWhole ? study.ladder.revisions[place] : own.extension?.after ?? extending(own)?.before ?? own.diagnosis?.base ?? own.comparison);
  const isOnLast = onLast.every(Boolean);
  const rungs = study.revisions.map(({ name, posterior }, place) => {
    const own = isOnLast ? onLast[place] : { ...posterior.heldout, rmse_heldout_um: posterior.heldout.rmse_um };
    return { name: titleOf(study, name), error: own.rmse_heldout_um ?? own.rmse_fitted_um };
  });
  at("rungs").hidden = rungs.length === 0;
  if (rungs.length === 0) return;
  const largest = Math.max(...rungs.map((rung) => rung.error), study.noise_um ?? 0);
  const line = (/** @type {string} */ name, /** @type {number} */ error, /** @type {string} */ kind) => {
    const bar = make("div", { className: `bar ${kind}` });
    bar.style.width = `${(100 * error) / largest}%`;
    return make("div", { className: "rung" }, [make("span", { textContent: name }), make("div", {}, [bar]), make("span", { className: "number", textContent: `${shown(error)} ${study.axes[3]}` })]);
  };
  at("ladder").replaceChildren(
    ...rungs.map(({ name, error }) => line(name, error, "")),
    ...(study.noise_um ? [line("noise", study.noise_um, "noise")] : []),
    make("p", { className: "lead", textContent: isWhole ? study.ladder.sentence : `Root mean square error on ${isOnLast ? "the last held-out cycle" : "all held-out cycles"}.` }),
  );
}

/** @param {Study} study @param {Revision|undefined} revision */
function showMap(study, revision) {
  const comparison = revision?.comparison;
  at("fails").hidden = !comparison;
  if (!comparison) return;
  at("fails-sentence").textContent = comparison.sentence;
  const tint = (/** @type {number} */ z, /** @type {boolean} */ isQuiet) => {
    const share = Math.min(1, Math.abs(z) / 6) * (isQuiet ? 0.15 : 1);
    return `color-mix(in srgb, ${z < 0 ? "#f08a4b" : "#4b9cd3"} ${100 * share}%, #eef1f4)`;
  };
  const body = comparison.panels.map((/** @type {any} */ panel) => {
    const isQuiet = panel.p_familywise >= 0.05;
    const cells = panel.bars.map((/** @type {any} */ bar) => {
      const isScore = panel.where === "runs" || panel.where === "autocorrelation";
      const words = `${shown(bar.bias_um)} ± ${shown(bar.sd_um)}${isScore ? "" : ` ${study.axes[3]}`} ${bar.phrase}`;
      const button = make("button", { type: "button", textContent: bar.label, title: words });
      button.setAttribute("aria-label", `${panel.title} ${bar.label}: ${words}`);
      button.style.background = tint(bar.bias_um / bar.sd_um, isQuiet);
      button.addEventListener("click", () => attempt(() => goTo(study, panel, bar, words)));
      return make("td", {}, [button]);
    });
    const p = make("td", { className: "p", textContent: `p = ${shown(panel.p_familywise, 2)}` });
    return make("tr", { className: isQuiet ? "quiet" : "" }, [make("th", { scope: "row", textContent: panel.title }), p, ...cells]);
  });
  at("map").replaceChildren(make("table", { className: "map" }, [make("tbody", {}, body)]));
}

/** Marks the times of a map's cell in the plots. @param {Study} study @param {any} panel @param {any} bar @param {string} words */
async function goTo(study, panel, bar, words) {
  const cycle = panel.where === "cycle" && study.cycles.find((own) => String(own.cycle) === bar.label);
  const marks = cycle ? [{ from: cycle.from_s, to: cycle.to_s }] : (bar.stretches_s ?? []).map((/** @type {[number, number]} */ [from, to]) => ({ from, to }));
  plots.mark(marks);
  const isWhole = marks.length === 0 || panel.where === "trend" || panel.where === "harmonics" || panel.where === "superposition";
  at("cell").textContent = `${panel.title}: ${words}. ${isWhole ? "This test concerns the whole record." : "Its times are marked in the plots."}`;
  // Short stretches after force steps are seen in one cycle only.
  const last = study.cycles.filter((own) => own.serves === "held out").pop() ?? study.cycles[study.cycles.length - 1];
  await setWindow(bar.lag_s ? [last.from_s, last.to_s] : null);
}

/** @param {Study} study @param {Revision|undefined} revision */
function showSuspects(study, revision) {
  const { diagnosis, learned } = revision ?? {};
  at("missing").hidden = !(diagnosis || learned);
  at("missing-sentence").textContent = diagnosis?.verdict.sentence ?? "";
  at("suspects").innerHTML = study.parts.suspects ?? "";
  at("fingerprint-of").textContent = "";
  plots.showFingerprint({ time_s: [0], left_um: [null], change_um: [null], claimed_um: [null] });
  const refused = new Set((diagnosis?.candidates ?? []).filter((/** @type {any} */ own) => own.refused).map((/** @type {any} */ own) => own.effect));
  at("suspects").querySelectorAll("tbody tr").forEach((row) => {
    const slug = row.querySelector("th")?.textContent ?? "";
    const button = action("Add", { kind: "extend", with: [slug] });
    button.setAttribute("aria-label", `Add ${slug}`);
    row.querySelector("th")?.after(make("td", {}, refused.has(slug) ? [] : [button]));
  });
  if (diagnosis && revision) showFingerprints(study, revision.name, diagnosis.verdict).catch(fault);
  at("suspects").querySelector("thead th")?.after(make("th", { scope: "col", textContent: "add to model" }));
  const parts = [];
  if (learned) {
    parts.push(make("h3", { textContent: "Correction of the law learnt from data" }), make("p", { textContent: learned.verdict.sentence }));
    if (learned.function) parts.push(make("p", {}, [make("img", { src: fileOf(study, `${revision?.name}/figures/learned.svg`), alt: `Learnt function of ${learned.verdict.quantity} by ${learned.verdict.state}, with its 90 per cent band` })]));
    if (learned.formula) parts.push(make("p", {}, [action("Add the learnt formula", { kind: "adopt" })]));
  }
  at("learned").replaceChildren(...parts);
}

/** Draws over the residuals what the candidate effect under the pointer would explain, beside the claimed effect. Equivalent effects have nearly equal curves.
 * @param {Study} study @param {string} name @param {{kind: string, effects: string[], equivalent: string[]}} verdict */
async function showFingerprints(study, name, verdict) {
  const response = await fetch(fileOf(study, `${name}/fingerprints.csv`));
  // Diagnoses of other versions may have no fingerprints.
  if (!response.ok) return;
  const text = await response.text();
  if (state.study !== study || state.revision !== name) return;
  const [head, ...rows] = text.trim().split("\n").map((line) => line.split(","));
  const column = (/** @type {number} */ place) => rows.map((row) => Number(row[place]));
  const [time_s, left_um] = [column(0), rows.map((row) => (row[1] === "" ? null : Number(row[1])))];
  const claimed = verdict.kind === "missing" ? verdict.effects[0] : "";
  const claimed_um = head.includes(claimed) ? column(head.indexOf(claimed)) : rows.map(() => null);
  const first = verdict.equivalent[0] ?? claimed;
  at("suspects").querySelectorAll("tbody tr").forEach((row) => {
    const place = head.indexOf(row.querySelector("th")?.textContent ?? "");
    if (place < 2) return;
    const isClaimed = head[place] === claimed;
    const own = { time_s, left_um, change_um: column(place), claimed_um: isClaimed ? rows.map(() => null) : claimed_um };
    const show = () => {
      const relation = verdict.equivalent.includes(head[place]) ? "which this record cannot distinguish from it" : "the claimed effect";
      const other = claimed && !isClaimed ? ` Dashed: ${claimed}, ${relation}.` : "";
      at("fingerprint-of").textContent = `Points: residuals. Line: part that ${head[place]} would explain.${other}`;
      plots.showFingerprint(own);
    };
    for (const kind of ["mouseenter", "focusin"]) row.addEventListener(kind, show);
    if (head[place] === first || (!first && row === row.parentElement?.firstElementChild)) show();
  });
}

/** @param {Study} study @param {string} path */
const fileOf = (study, path) => `file?${query({ item: study.item.name, path, of: state.folder })}`;

/** @param {Study} study */
function showFiles(study) {
  const name = state.revision;
  at("export").hidden = name === null;
  if (name === null) return;
  const archive = make("a", { href: `api/archive?${query({ item: study.item.name })}`, textContent: `${study.item.name.split("/").pop()}.zip`, download: `${study.item.name.split("/").pop()}.zip` });
  const list = [["report.html", "the whole study on one page"], [`${name}/figures/predictive.svg`, "measurement and predictions"], [`${name}/figures/corner.svg`, "the posterior"], [`${name}/figures/trace.svg`, "the chains of the sampler"], [`${name}/figures/comparison_map.svg`, "the failure map"],
    [`${name}/figures/diagnosis.svg`, "all candidate effects"], ["ladder.svg", "error of each revision"], [`${name}/predictions.csv`, "predictions for every row"], [`${name}/draws.csv`, "posterior draws"], [`${name}/posterior.nc`, "posterior draws for ArviZ"]];
  const revision = study.revisions.find((own) => own.name === name);
  const isThere = (/** @type {string} */ path) => !(path.includes("comparison") && !revision?.comparison) && !(path.includes("diagnosis") && !revision?.diagnosis) && !(path.startsWith("ladder") && !study.ladder);
  at("files").replaceChildren(make("li", {}, [archive, ": the record and its whole study"]), ...list.filter(([path]) => isThere(path)).map(([path, words]) => {
    const link = (/** @type {string} */ file, /** @type {string} */ text) => make("a", { href: fileOf(study, file), textContent: text, download: file.endsWith("html") ? "" : file.split("/").pop(), target: "_blank" });
    const other = (/** @type {string} */ format) => link(path.replace(/svg$/, format), format);
    return make("li", {}, [link(path, path), ...(path.endsWith("svg") ? [" (", other("png"), ", ", other("pdf"), ")"] : []), `: ${words}`]);
  }), ...showTable());
}

/** Links to the shown table of parameters, as CSV and as LaTeX. @returns {HTMLElement[]} */
function showTable() {
  const rows = [...at("parameters").querySelectorAll("tr")].map((row) => [...row.children].map((cell) => cell.textContent?.trim() ?? ""));
  if (rows.length === 0) return [];
  const csv = rows.map((cells) => cells.map((cell) => (/[",]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell)).join(",")).join("\r\n") + "\r\n";
  const digits = (/** @type {string} */ text, /** @type {string} */ from) => [...text].map((own) => (from.includes(own) ? "-0123456789"[from.indexOf(own)] : own)).join("");
  const latexOf = (/** @type {string} */ cell) => cell
    .replace(/[&%#_$]/g, "\\$&")
    .replace(/[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+/g, (own) => `$^{${digits(own, "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")}}$`)
    .replace(/[₀₁₂₃₄₅₆₇₈₉]+/g, (own) => `$_{${digits(own, "\0₀₁₂₃₄₅₆₇₈₉")}}$`)
    .replaceAll("−", "$-$").replaceAll("·", "$\\cdot$").replaceAll("×", "$\\times$").replaceAll("µ", "$\\mu$").replaceAll("σ", "$\\sigma$");
  const latex = `\\begin{tabular}{l${"r".repeat(rows[0].length - 1)}}\n${rows.map((cells) => `${cells.map(latexOf).join(" & ")} \\\\`).join("\n")}\n\\end{tabular}\n`;
  return [["parameters.csv", csv], ["parameters.tex", latex]].map(([name, text]) => {
    const link = make("a", { textContent: name, download: name, href: URL.createObjectURL(new Blob([text], { type: "text/plain" })) });
    return make("li", {}, [link, ": the table of parameters"]);
  });
}

// ---- Trials by hand ----

async function refreshKnobs() {
  at("by-hand").hidden = state.revision === null;
  if (state.revision === null) return;
  const [item, revision, effect] = [state.item, state.revision, state.effect];
  const { knobs, effects } = await send("api/knobs", { item, revision, effects: effect ? [effect] : [] });
  if (item !== state.item || revision !== state.revision || effect !== state.effect) return;
  state.knobs = knobs;
  state.values = {};
  plots.showTried(null);
  at("tried").textContent = "";
  at("try-effect").replaceChildren(make("option", { value: "", textContent: "nothing" }), ...(effect ? [make("option", { value: effect, textContent: effect, selected: true })] : []),
    ...effects.map((/** @type {any} */ own) => make("option", { value: own.slug, textContent: own.slug, title: own.summary })));
  at("sliders").replaceChildren(...knobs.map(slider));
  if (effect) tryNow();
}

/** @param {Knob} knob */
function slider(knob) {
  // Sliders of the law are logarithmic. Sliders of effects use the cube root of the distance from the null, because visible changes are often small.
  const none = knob.null_value ?? 0;
  const bent = knob.is_logarithmic ? Math.log : knob.null_value === null ? (/** @type {number} */ own) => own : (/** @type {number} */ own) => Math.cbrt(own - none);
  const straight = knob.is_logarithmic ? Math.exp : knob.null_value === null ? (/** @type {number} */ own) => own : (/** @type {number} */ own) => none + own ** 3;
  const [from, to] = [bent(knob.low), bent(knob.high)];
  const value = (/** @type {number} */ place) => straight(from + ((to - from) * place) / 1000);
  const place = (1000 * (bent(knob.value) - from)) / (to - from);
  const words = (/** @type {number} */ own) => `${shown(own, 4)} ${knob.unit}`;
  const output = make("output", { textContent: words(knob.value) });
  const input = make("input", { type: "range", min: "0", max: "1000", step: "1", value: String(place) });
  input.setAttribute("aria-label", `${knob.symbol} in ${knob.unit || "no unit"}`);
  input.addEventListener("input", () => {
    const own = value(Number(/** @type {HTMLInputElement} */ (input).value));
    output.textContent = words(own);
    state.values[knob.name] = own;
    tryNow();
  });
  return make("label", { className: "slider" }, [make("span", { textContent: knob.symbol }), input, output]);
}

let isTrying = false, isStale = false;
/** Requests the curve of the trial. Only one request runs at a time, and the last slider position is always requested. */
function tryNow() {
  if (isTrying) {
    isStale = true;
    return;
  }
  isTrying = true;
  const [from_s, to_s] = state.window ?? [null, null];
  const { item, revision, effect, values } = state;
  const points = plots.points();
  send("api/try", { item: state.item, revision: state.revision, effects: state.effect ? [state.effect] : [], parameters: state.values, from_s, to_s, points, is_logarithmic: plots.isLogTime })
    .then((curve) => {
      // The answer may be that of another record, revision or effect.
      if (item !== state.item || revision !== state.revision || effect !== state.effect || values !== state.values) return;
      plots.showTried(curve);
      const noise = state.study?.noise_um, unit = state.study?.axes[3] ?? "";
      at("tried").textContent = `Error of the trial: ${shown(curve.rmse_fitted_um)} ${unit} on fitted cycles${curve.rmse_heldout_um === null ? "" : `, ${shown(curve.rmse_heldout_um)} ${unit} on held-out cycles`}${noise ? `; noise ${shown(noise)} ${unit}` : ""}`;
    })
    .catch(fault)
    .finally(() => {
      isTrying = false;
      if (isStale) {
        isStale = false;
        if (state.item !== null && state.revision !== null) tryNow();
      }
    });
}

// ---- Time windows ----

/** @param {[number, number]|null} window */
async function setWindow(window) {
  state.window = window;
  await refreshRows();
  if (state.study) at("window").querySelectorAll("option").forEach((own) => (own.selected = own.value === (window ? `${window[0]} ${window[1]}` : "")));
}
at("log-time").addEventListener("change", (event) => attempt(() => {
  plots.setLogTime(/** @type {HTMLInputElement} */ (event.target).checked);
  return refreshRows();
}));
const plots = new Plots((from, to) => attempt(() => setWindow(from === null || to === null ? null : [from, to])));

// ---- Jobs and events ----

/** @type {Record<string, string>} */
const KINDS = { sample: "Fitting the model", compare: "Testing the residuals", diagnose: "Finding missing effects", learn: "Learning from the data", extend: "Extending the model", adopt: "Adding the learnt formula", groups: "Comparing groups", example: "Making a sample record", "sample-many": "Fitting", "diagnose-many": "Diagnosing" };
/** A job that takes longer is reported in the title of a page in the background, in ms. */
const LONG_MS = 20_000;

/** Whether the user wants a notification at the end of the running job. */
let isNotified = false;
at("job-notify").addEventListener("click", () => attempt(async () => {
  isNotified = (await Notification.requestPermission()) === "granted";
  at("job-notify").hidden = true;
  if (!isNotified) throw new Error("The browser does not allow notifications of this page. Allow them in its settings.");
}));

/** First news of the present stage of the job: what it is, steps done, and time in ms. */
let stage = { key: "", done: 0, at: 0 };

/** @param {number} seconds */
const duration = (seconds) => (seconds < 90 ? `${Math.round(seconds)} s` : seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${shown(seconds / 3600, 2)} h`);

/** Shows how far the job is: a percentage and the remaining time where the stage counts its steps, otherwise the time since its start. */
function showTime() {
  const job = state.job;
  if (job?.standing !== "running") return;
  const elapsed = `${duration(Math.max(0, Date.now() / 1000 - job.began_s))} since the start`;
  if (!job.progress) {
    at("job-time").textContent = elapsed;
    return;
  }
  const [done, all] = job.progress;
  const rate = (done - stage.done) / (Date.now() - stage.at);
  const rest = rate > 0 ? `, about ${duration((all - done) / rate / 1000)} left in this step` : "";
  at("job-time").textContent = `${Math.floor((100 * done) / all)} %${rest}; ${elapsed}`;
}
setInterval(showTime, 500);

/** @param {Job|null} job */
function showJob(job) {
  const before = state.job;
  state.job = job;
  const runs = job?.standing === "running";
  at("job").hidden = !runs;
  if (job && runs) {
    const step = job.commands.length > 1 ? ` (command ${job.at + 1} of ${job.commands.length})` : "";
    at("job-words").textContent = `${KINDS[job.kind]}: ${job.item}${step}. ${job.words}`;
    const bar = /** @type {HTMLProgressElement} */ (at("job-progress"));
    const key = `${job.began_s} ${job.at} ${job.words} ${job.progress?.[1]}`;
    if (key !== stage.key) stage = { key, done: job.progress?.[0] ?? 0, at: Date.now() };
    if (job.progress) [bar.max, bar.value] = [job.progress[1], job.progress[0]];
    else bar.removeAttribute("value");
    at("job-notify").hidden = isNotified || !("Notification" in window) || Notification.permission === "denied";
    showTime();
  }
  measureTop();
  document.querySelectorAll("[data-action]").forEach((button) => (/** @type {HTMLButtonElement} */ (button).disabled = runs));
  const hasEnded = job && before?.standing === "running" && !runs;
  if (!job || !hasEnded) return;
  if (document.hidden && Date.now() - 1000 * job.began_s > LONG_MS) document.title = `${job.standing === "done" ? "✓" : "✗"} ${KINDS[job.kind]} – ${document.title}`;
  if (isNotified) new Notification(`${KINDS[job.kind]}: ${job.item}`, { body: job.standing === "done" ? "The job is done." : job.words });
  isNotified = false;
  if (job.standing !== "done") fault(new Error(`${KINDS[job.kind]}: ${job.words}`));
  if (job.standing === "done" && (job.kind === "groups" || job.kind === "example")) attempt(() => refreshItems().then(() => open(job.item)));
  else if (state.item === null) refreshItems().catch(fault);
  else if (job.item === state.item) {
    if (job.kind === "extend" || job.kind === "adopt" || job.kind === "sample") state.revision = null;
    refresh().catch(fault);
  }
}

/** @param {any} news */
function onNews(news) {
  showJob(news.job);
  if (news.state !== state.folder && state.folder) {
    refreshItems().catch(fault);
    if (state.item !== null && !(news.job?.standing === "running" && news.job.item === state.item)) refresh().catch(fault);
  }
  state.folder = news.state;
}

/** The columns of a record begin below the bar at the top of the page, whose height changes. */
function measureTop() {
  document.documentElement.style.setProperty("--top", `${at("top").offsetHeight}px`);
}

// ---- Changes of whole records ----

/** @param {any} change */
async function changeRecord(change) {
  const { item, undo } = await send("api/record", change);
  at("undo").hidden = undo === null;
  if (undo !== null) {
    at("undo-words").textContent = change.revision ? `${change.revision} of ${change.item} was deleted.` : `${change.item} was deleted, with its models.`;
    at("undo-do").onclick = () => attempt(() => changeRecord({ change: "undo", number: undo }));
  }
  await refreshItems();
  await open(item);
}

/** Description as it was read, and the record that it belongs to. @type {{item: string|null, before: string}} */
let described = { item: null, before: "" };
at("description").addEventListener("toggle", () => attempt(async () => {
  const { item } = state;
  const area = /** @type {HTMLTextAreaElement} */ (at("description-text"));
  described = { item: null, before: "" };
  area.value = "";
  if (item === null || !at("description").hasAttribute("open")) return;
  at("delete-revision").hidden = state.revision === null;
  /** @type {HTMLInputElement} */ (at("new-name")).value = item;
  const { text } = await ask(`api/description?${query({ item })}`);
  if (item !== state.item) return;
  described = { item, before: text };
  area.value = text;
}));
at("describe").addEventListener("submit", (event) => {
  event.preventDefault();
  if (described.item !== state.item) return;
  attempt(() => changeRecord({ change: "describe", ...described, text: /** @type {HTMLTextAreaElement} */ (at("description-text")).value }));
});
at("rename").addEventListener("submit", (event) => {
  event.preventDefault();
  const change = /** @type {HTMLButtonElement} */ (event.submitter)?.value || "rename";
  attempt(() => changeRecord({ change, item: state.item, name: /** @type {HTMLInputElement} */ (at("new-name")).value }));
});
at("delete-revision").addEventListener("click", () => attempt(() => changeRecord({ change: "delete", item: state.item, revision: state.revision })));
at("delete").addEventListener("click", () => attempt(() => changeRecord({ change: "delete", item: state.item })));
at("undo-close").addEventListener("click", () => (at("undo").hidden = true));

// ---- Start ----

const project = new Project(
  (name) => attempt(() => open(name)),
  async (kind, names) => showJob(await send("api/job", { item: "", kind, with: names })),
);
at("example").addEventListener("click", () => attempt(async () => showJob(await send("api/job", { item: "", kind: "example" }))));
addEventListener("popstate", () => attempt(() => open(...addressed())));
new ResizeObserver(measureTop).observe(at("top"));
at("items").addEventListener("change", (event) => attempt(() => open(/** @type {HTMLSelectElement} */ (event.target).value || null)));
at("revision").addEventListener("change", (event) => attempt(() => {
  state.revision = /** @type {HTMLSelectElement} */ (event.target).value;
  state.values = {};
  at("cell").textContent = at("tried").textContent = "";
  plots.showTried(null);
  plots.mark([]);
  setAddress();
  return refresh();
}));
at("compared").addEventListener("change", (event) => attempt(async () => {
  state.compared = /** @type {HTMLSelectElement} */ (event.target).value || null;
  if (state.study) showStudy(state.study);
  await refreshRows();
}));
at("window").addEventListener("change", (event) => attempt(() => {
  const [from, to] = /** @type {HTMLSelectElement} */ (event.target).value.split(" ").map(Number);
  plots.mark([]);
  return setWindow(to === undefined ? null : [from, to]);
}));
at("try-effect").addEventListener("change", (event) => attempt(() => {
  state.effect = /** @type {HTMLSelectElement} */ (event.target).value;
  return refreshKnobs();
}));
at("try-reset").addEventListener("click", () => attempt(() => {
  state.effect = "";
  return refreshKnobs();
}));
at("compare-start").addEventListener("click", () => attempt(async () => showJob(await send("api/job", { item: "", kind: "groups", with: /** @type {HTMLSelectElement} */ (at("by")).value.split(",") }))));
at("job-stop").addEventListener("click", () => attempt(async () => void (await ask("api/job", { method: "DELETE" }))));
at("fault-close").addEventListener("click", () => (at("fault").hidden = true));
at("table").addEventListener("change", (event) => {
  const input = /** @type {HTMLInputElement} */ (event.target);
  const file = input.files?.[0];
  if (file) attempt(() => upload(file));
  input.value = "";
});
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
});
addEventListener("dragleave", () => document.body.classList.remove("dropping"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("dropping");
  const file = event.dataTransfer?.files[0];
  if (file) attempt(() => upload(file));
});
attempt(async () => {
  // A server that was started again may have other files.
  listen(onNews, () => attempt(() => refreshItems().then(() => (state.item === null ? Promise.resolve() : refresh()))));
  const [name, revision] = addressed();
  await readGlossary();
  await refreshItems();
  await open(state.items.some((item) => item.name === name) ? name : null, revision);
});
