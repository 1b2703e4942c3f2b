// Motion by hand with a gamepad, where the browser gives it: on https and on this computer. What it holds is an arrow of
// the pad like any other, and ends with it: also when it is unplugged, the page is hidden, or the focus is lost.

import { keep, kept } from "../core/kept.js";
import { on } from "../core/socket.js";
import { mount, state } from "../core/store.js";
import { onView } from "../core/views.js";
import { stop } from "../frame/stop.js";
import { changeRate, pressAt, rateKey, releaseAt } from "./jog.js";
import { step } from "./steps.js";
import { Stick } from "./stick.js";

const EVERY = 50;
/** Each gamepad by its index. All have STOP; the first one moves the mount. */
const sticks = new Map();
let timer = 0;
/** The places of the arrows that the gamepad has pressed, also those that were refused. */
let places = new Set();
let number = -1;
/** The mount that is shown. */
let shown = null;

const pads = () => [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.mapping === "standard");

export const words = () => !isSecureContext
  ? "Most browsers give a gamepad on https, and on the gateway's own computer, only."
  : `A gamepad moves the mount with its left stick while a shoulder button is held; B is STOP, up and down of the cross change the rate.${used() && pads().length ? " One is connected." : ""}`;

function read(pad) {
  if (!sticks.has(pad.index)) sticks.set(pad.index, new Stick());
  return sticks.get(pad.index).take(pad, performance.now(), mount()?.speeds?.[rateKey() - 1] ?? null);
}

function end() {
  for (const place of places) releaseAt(place);
  places = new Set();
  for (const stick of sticks.values()) stick.reset();
}

function poll() {
  const pad = pads()[0];
  if (!pad) {
    end();
    clearInterval(timer);
    timer = 0;
    return;
  }
  if (pad.index !== number) {
    end();
    number = pad.index;
  }
  const all = pads().map(read), [asked] = all;
  if (all.some((one) => one.stop)) {
    end();
    stop();
    return;
  }
  if (document.hidden || !document.hasFocus()) return end();
  if (state.chosen !== shown) {
    shown = state.chosen;
    return end();
  }
  if (asked.faster) changeRate(asked.faster);
  if (!state.act || step()) return end();
  const wanted = new Set(asked.places);
  for (const place of places) if (!wanted.has(place)) releaseAt(place);
  for (const place of wanted) if (!places.has(place)) pressAt(place);
  places = wanted;
}

/** Whether gamepads are used here: a browser that listens for them asks its computer for them all the time. */
export const used = () => kept("gamepad") === "on";

export function use() {
  keep("gamepad", "on");
  start();
}

export function start() {
  if (!used()) return;
  const begin = () => (timer ||= setInterval(poll, EVERY));
  addEventListener("gamepadconnected", begin);
  addEventListener("gamepaddisconnected", () => {
    end();
    number = -1;
  });
  for (const ending of ["blur", "pagehide"]) addEventListener(ending, end);
  document.addEventListener("visibilitychange", () => document.hidden && end());
  on("lost", end);
  onView(end);
  if (pads().length) begin();
}
