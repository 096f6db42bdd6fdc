// @ts-check
// Elements of the page, requests to the server, and the messages about them.

/** @template {HTMLElement} T @param {string} id @returns {T} */
export const at = (id) => /** @type {T} */ (document.getElementById(id));
/** @param {string} tag @param {Record<string, any>} [properties] @param {(Node|string)[]} [children] */
export const make = (tag, properties = {}, children = []) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};
/** @param {number|null|undefined} value @param {number} [digits] */
export const shown = (value, digits = 3) => (value === null || value === undefined ? "–" : String(Number(value.toPrecision(digits))));

/** The server did not answer; a banner says so until it answers again. */
class Unanswered extends Error {}

/** @param {string} path @param {RequestInit} [options] @returns {Promise<any>} */
export async function ask(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Unanswered();
  }
  if (!response.ok) {
    const text = await response.text();
    let words = text;
    try {
      words = JSON.parse(text).error ?? text;
    } catch {
      // A response that is not JSON is shown unchanged.
    }
    throw new Error(words);
  }
  return response.json();
}

/** @param {string} path @param {unknown} body */
export const send = (path, body) => ask(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
/** @param {Record<string, string|number|null|undefined>} values */
export const query = (values) => new URLSearchParams(Object.entries(values).flatMap(([key, value]) => (value === null || value === undefined ? [] : [[key, String(value)]])));

/** @param {unknown} error */
export function fault(error) {
  if (error instanceof Unanswered) {
    // If the workbench has ended, a banner says so. Otherwise only this request failed.
    setTimeout(() => at("lost").hidden && fault("The request did not reach the workbench. A table must be a file of at most 256 MiB."), 1500);
    return;
  }
  at("fault-words").textContent = error instanceof Error ? error.message : String(error);
  at("fault").hidden = false;
}
/** Runs an action of the user, and shows its errors. @param {() => Promise<void>} work */
export const attempt = async (work) => {
  at("fault").hidden = true;
  try {
    await work();
  } catch (error) {
    fault(error);
  }
};

/** Time between two attempts to reach a server that does not answer, in ms. */
const RETRY_MS = 700;

/** Listens to the server's events. A banner says when the server does not answer, and the page goes on when it answers again.
 * @param {(news: any) => void} onNews @param {() => void} onReturn called when the server answers again */
export function listen(onNews, onReturn) {
  const events = new EventSource("api/events");
  events.onmessage = (message) => {
    if (!at("lost").hidden) {
      at("lost").hidden = true;
      onReturn();
    }
    onNews(JSON.parse(message.data));
  };
  events.onerror = () => {
    events.close();
    if (at("lost").hidden) at("lost-since").textContent = `No answer since ${new Date().toLocaleTimeString()}.`;
    at("lost").hidden = false;
    // Whether the job runs is not known.
    at("job").hidden = true;
    setTimeout(() => listen(onNews, onReturn), RETRY_MS);
  };
}
