// The WebSocket to the gateway: requests with answers, a beat twice a second, and reconnection after a loss.
// The gateway says something every second: a connection that is open but dead is detected by its silence.

import { changed, state, take } from "./store.js";

const BEAT = 500;
const DEAD = 4000;
/** Milliseconds in which the gateway must answer after the device has lost its network. */
const OFFLINE = 500;
/** Milliseconds without news after which the figures of a mount that moves are no longer true. */
const OLD = 1500;
/** Milliseconds until it connects again, by the number of attempts, and at most while it is urgent. */
const AGAIN = [300, 600, 1000, 2000, 3000], SOON = 300;
// The gateway has closed this page, because too many are open.
const CROWDED = 1013;
const LATER = 60000;

/** @type {WebSocket | null} */
let ws = null;
let number = 0;
let attempts = 0;
/** The timer of the next attempt; 0 while there is none. */
let timer = 0;
let isUrgent = () => false;
let heard = 0, spoke = 0;
let beat = () => ({});
/** @type {Map<number, (answer: any) => void>} */
const waiting = new Map();
/** @type {Record<string, Array<(value: any) => void>>} */
const listeners = { talk: [], line: [], open: [], lost: [], ordered: [] };
const MOTIONS = ["goto", "jog", "guide", "park", "home"];

const meta = (name, page = document) => page.querySelector(`meta[name="${name}"]`)?.getAttribute("content") ?? "";
export const token = meta("token");

/** Subscribe to `talk`, `line` (the answer times of every mount), `open` or `lost` (the connection), `ordered` (a motion, from here). */
export const on = (event, listener) => listeners[event].push(listener);
const emit = (event, value) => listeners[event].forEach((listener) => listener(value));

/** Send with every beat what a function returns. */
export function inBeats(content) {
  beat = content;
}

/** While a function returns true, connecting again is urgent. */
export function urgentIf(condition) {
  isUrgent = condition;
}

/** Send a message that needs no answer. False if there is no connection. */
export function tell(request) {
  if (ws?.readyState !== WebSocket.OPEN) return false;
  ws.send(JSON.stringify({ mount: state.chosen, ...request }));
  return true;
}

/** Send a request. There is always an answer: `{ok, words, ...}`, ok false if the gateway was not reached. */
export function ask(request) {
  return new Promise((resolve) => {
    const id = ++number;
    waiting.set(id, resolve);
    if (MOTIONS.includes(request.do)) emit("ordered");
    if (!tell({ ...request, id })) {
      waiting.delete(id);
      resolve({ ok: false, lost: true, words: "The gateway cannot be reached, so nothing was done." });
    }
  });
}

/** Seconds since the gateway has said anything. */
export const silence = () => (performance.now() - spoke) / 1000;

function hear(event) {
  heard = spoke = performance.now();
  const message = JSON.parse(event.data);
  if (message.id) {
    waiting.get(message.id)?.(message);
    waiting.delete(message.id);
    return;
  }
  if (message.talk) emit("talk", message.talk);
  emit("line", message.hello?.times ?? message.mounts?.map((one) => one.times) ?? []);
  if (message.hello || message.mounts) take(message);
}

export function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  const early = globalThis.early?.ws.readyState <= WebSocket.OPEN ? globalThis.early : null;
  const mine = early?.ws ?? new WebSocket(`${scheme}//${location.host}/socket?token=${encodeURIComponent(token)}`);
  ws = mine;
  heard = performance.now();
  const begin = () => {
    attempts = 0;
    state.connected = true;
    changed();
    emit("open");
  };
  if (mine.readyState === WebSocket.OPEN) begin();
  else mine.addEventListener("open", begin);
  mine.onmessage = null;
  mine.addEventListener("message", hear);
  early?.heard.forEach(hear);
  globalThis.early = null;
  mine.addEventListener("close", (event) => mine === ws && lost(event.code === CROWDED));
}

function lost(crowded = false) {
  ws?.close();
  ws = null;
  const was = state.connected;
  state.connected = false;
  state.crowded = crowded;
  for (const resolve of waiting.values()) {
    resolve({ ok: false, lost: true, words: "The connection broke before the gateway answered; look at what the mount does." });
  }
  waiting.clear();
  changed();
  if (was) emit("lost");
  later(crowded ? LATER : undefined);
}

function later(pause = AGAIN[Math.min(attempts++, AGAIN.length - 1)]) {
  timer = setTimeout(again, isUrgent() ? SOON : pause);
}

/** Connect again at once if the next attempt still waits. */
export function hurry() {
  if (!timer) return;
  clearTimeout(timer);
  again();
}

/** Reconnect. After a restart the gateway has a new token, which only a reloaded page knows. */
async function again() {
  timer = 0;
  try {
    const page = await (await fetch("/", { cache: "no-store", signal: AbortSignal.timeout(DEAD) })).text();
    if (meta("token", new DOMParser().parseFromString(page, "text/html")) !== token) {
      location.reload();
      return;
    }
  } catch {
    later();
    return;
  }
  connect();
}

setInterval(() => {
  if (!tell({ do: "beat", ...beat() })) return;
  const quiet = performance.now() - heard;
  if (state.quiet !== quiet > OLD) {
    state.quiet = quiet > OLD;
    changed();
  }
  if (quiet > DEAD) lost();
}, BEAT);

addEventListener("online", () => {
  attempts = 0;
  hurry();
});
// A computer without a network still reaches a gateway of its own: it is asked whether it is there.
addEventListener("offline", () => {
  const mine = ws, given = setTimeout(() => mine && mine === ws && lost(), OFFLINE);
  ask({ do: "search", text: "" }).then(() => clearTimeout(given));
});
