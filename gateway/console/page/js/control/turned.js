// Which way up the chart is, and with it the pad: east and west of the pad stand where the chart shows them.
// An alt-azimuth mount agrees with the chart everywhere only while the tube is at the bottom of it.

import { keep, kept } from "../core/kept.js";

const UPS = ["north", "south", "zenith"];
const listeners = [];
let up = UPS.includes(kept("chart-up")) ? kept("chart-up") : "north";

/** Call a function with what is up (`north`, `south`, or `zenith`: the tube is at the bottom), now and after a change. */
export function onTurn(listener) {
  listeners.push(listener);
  listener(up);
}

/** Turn the chart to the next position. */
export function turn() {
  up = UPS[(UPS.indexOf(up) + 1) % UPS.length];
  keep("chart-up", up);
  listeners.forEach((listener) => listener(up));
}

/** What is up. */
export const turnedUp = () => up;
