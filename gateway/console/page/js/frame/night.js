// The page's colours: day, or red for the night, in six steps of brightness. In automatic mode it is red while the Sun
// at the mount is more than six degrees below the horizon; the browser stores the user's choice.

import { byId } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { mount, subscribe } from "../core/store.js";
import { notice } from "./notices.js";

const DUSK = -6;
const root = document.documentElement;
const listeners = [];
let mode = kept("light-mode") ?? "auto";
let explained = kept("light-explained") !== null;

export const light = () => ({ mode, night: root.dataset.light === "night", step: Number(root.dataset.step) });

/** Call a function after every change of the colours, and once now. */
export function onLight(listener) {
  listeners.push(listener);
  listener();
}

/** The Sun's altitude at the mount in degrees; null while it is unknown. */
export const sunAltitude = () => mount()?.bodies?.find((body) => body.name === "Sun")?.alt ?? null;

function show(night) {
  const name = night ? "night" : "day";
  if (root.dataset.light === name) return;
  root.dataset.light = name;
  root.toggleAttribute("data-night", night);
  keep("light-shown", name);
  apply();
}

function apply() {
  const { night } = light();
  const paper = getComputedStyle(document.body).backgroundColor;
  document.querySelector('meta[name="theme-color"]').setAttribute("content", paper);
  byId("light").setAttribute("aria-pressed", String(night));
  listeners.forEach((listener) => listener());
}

/** @param {"auto"|"day"|"night"} wanted */
export function setMode(wanted) {
  mode = wanted;
  keep("light-mode", wanted);
  if (wanted !== "auto") show(wanted === "night");
  follow();
  apply();
}

/** @param {number} step  -1 darkest to 4 brightest */
export function setStep(step) {
  root.dataset.step = String(step);
  keep("light-step", String(step));
  apply();
}

function follow() {
  const sun = sunAltitude();
  if (mode !== "auto" || sun === null) return;
  show(sun < DUSK);
  if (sun < DUSK) explain();
}

/** Explain the red page once in every browser, because a new user may take it for an error. */
function explain() {
  if (explained) return;
  explained = true;
  keep("light-explained", "1");
  notice("Red while the Sun is down. The Sun's button changes that.");
}

export function start() {
  byId("light").addEventListener("click", () => {
    const sun = sunAltitude(), night = !light().night;
    setMode(sun !== null && night === sun < DUSK ? "auto" : night ? "night" : "day");
  });
  subscribe(follow);
  apply();
}
