// The position of the telescope, in the upper corners of the chart.

import { byId, el, say } from "../core/dom.js";
import { angle, azimuth, declination, hours } from "../core/format.js";
import { mount, subscribe } from "../core/store.js";

const FIGURES = [
  ["RA", (at) => hours(at?.ra)],
  ["Alt", (at) => angle(at?.alt)],
  ["Dec", (at) => declination(at?.dec)],
  ["Az", (at) => azimuth(at?.az)],
];

export function start() {
  const values = FIGURES.map(() => el("dd", {}));
  byId("glance").replaceChildren(...FIGURES.map(([words], index) => el("div", {}, el("dt", {}, words), values[index])));
  subscribe(() => FIGURES.forEach(([, figure], index) => say(values[index], figure(mount()?.position))));
}
