// The live conversation of both sides. The gateway sends it only while it is shown; the display can be paused.

import { BUTTONS, CHOICES, NAMES } from "../core/labels.js";
import { button, byId, changingChoice, choice, el } from "../core/dom.js";
import { notice } from "../frame/notices.js";
import { on, tell } from "../core/socket.js";
import { state, subscribe } from "../core/store.js";
import { onView, view } from "../core/views.js";
import { asText, Exchanges } from "./exchanges.js";
import * as explain from "./explain.js";
import { passes } from "./filter.js";
import { recordButtons } from "./record.js";
import { element } from "./row.js";

const exchanges = new Exchanges();
/** @type {Map<string, any>} exchange key -> its element */
const shown = new Map();
/** @type {import("./filter.js").Filter} */
const filter = { what: "programs", side: "", text: "" };
let paused = false;
/** @type {any[]} rows received while paused */
let kept = [];
let listening = false;
/** Shows which programs can be chosen. */
let showSides = null;

const shows = (exchange) => exchange.mount === state.chosen && passes(exchange, filter);

function put(rows) {
  const box = byId("conversation");
  // Do not scroll while the user reads further up.
  const follows = box.scrollHeight - box.scrollTop - box.clientHeight < 40;
  for (const exchange of exchanges.add(rows)) showOne(box, exchange);
  const alive = new Set(exchanges.all.map((one) => one.key));
  for (const [key, old] of shown) {
    if (!alive.has(key)) {
      old.remove();
      shown.delete(key);
    }
  }
  offerSides();
  empty(box);
  if (follows) box.scrollTop = box.scrollHeight;
}

function showOne(box, exchange) {
  const before = shown.get(exchange.key);
  if (!shows(exchange)) return;
  const made = element(exchange);
  if (before) before.replaceWith(made);
  else box.append(made);
  shown.set(exchange.key, made);
}

function all() {
  const box = byId("conversation");
  shown.clear();
  box.replaceChildren();
  exchanges.all.forEach((exchange) => showOne(box, exchange));
  empty(box);
  box.scrollTop = box.scrollHeight;
}

const EMPTY = {
  programs: "Nothing yet. As soon as a program says something, it stands here: its command, what it became on the mount's line, and the reply.",
  refused: "Nothing has been refused since this view was opened.",
  all: "Nothing yet.",
};

function empty(box) {
  const note = box.querySelector(".nothing");
  if (shown.size) note?.remove();
  else if (!note) box.append(el("p", { class: "nothing hint" }, EMPTY[filter.what]));
}

function offerSides() {
  const now = [...new Set(exchanges.all.filter((one) => !one.own && one.mount === state.chosen).map((one) => one.side))];
  if (filter.side && !now.includes(filter.side)) now.push(filter.side);
  showSides(now.length > 1 ? [["", NAMES.everyProgram], ...now.map((side) => [side, side])] : [], filter.side);
}

async function copy() {
  const text = exchanges.all.filter(shows).map(asText).join("\n");
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Browsers allow the clipboard API only for local or HTTPS pages; otherwise use the older method.
    const area = el("textarea", { class: "away", "aria-hidden": "true" });
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  notice(`Copied ${text ? text.split("\n").length : 0} lines.`);
}

function pause(pressed) {
  paused = !paused;
  pressed.setAttribute("aria-pressed", String(paused));
  pressed.textContent = paused ? BUTTONS.goOn : BUTTONS.pause;
  if (paused) return;
  put(kept);
  kept = [];
}

function listen() {
  const wanted = view() === "talk" && !document.hidden;
  if (wanted === listening) return;
  listening = wanted;
  tell({ do: "talk", on: wanted });
}

function tools() {
  const what = el("div", { class: "chips", role: "radiogroup", "aria-label": NAMES.shown });
  const chosen = choice(what, CHOICES.shown, (value) => {
    filter.what = value;
    chosen.set(value);
    all();
  });
  chosen.set(filter.what);
  const text = el("input", { type: "text", placeholder: NAMES.contains, "aria-label": NAMES.filter, maxlength: 60, spellcheck: "false", autocomplete: "off", on: { input: () => { filter.text = text.value; all(); } } });
  const pausing = button(BUTTONS.pause, () => pause(pausing), { "aria-pressed": "false" });
  byId("talk-tools").replaceChildren(what, text,
    el("div", { class: "chips", id: "talk-sides", role: "radiogroup", "aria-label": NAMES.side, hidden: true }),
    el("div", { class: "chips right" }, pausing, button(BUTTONS.copy, copy), ...recordButtons()));
  showSides = changingChoice(byId("talk-sides"), (side) => {
    filter.side = side;
    offerSides();
    all();
  });
}

export function start() {
  tools();
  explain.start();
  empty(byId("conversation"));
  on("talk", (rows) => {
    if (!paused) return put(rows);
    kept = [...kept, ...rows].slice(-2000);
  });
  let mount = state.chosen;
  subscribe(() => {
    if (mount === state.chosen) return;
    mount = state.chosen;
    filter.side = "";
    offerSides();
    all();
  });
  on("open", () => {
    listening = false;  // a new connection begins without the conversation
    listen();
  });
  onView(listen);
  document.addEventListener("visibilitychange", listen);
}
