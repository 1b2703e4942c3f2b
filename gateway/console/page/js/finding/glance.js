// The position of the telescope, in the upper corners of the chart.

import { READINGS } from "../core/labels.js";
import { byId, el, say } from "../core/dom.js";
import { angle, azimuth, declination, hours } from "../core/format.js";
import { mount, subscribe } from "../core/store.js";

const FIGURES = [
  [READINGS.raShort, (at) => hours(at?.ra)],
  [READINGS.altShort, (at) => angle(at?.alt)],
  [READINGS.decShort, (at) => declination(at?.dec)],
  [READINGS.azShort, (at) => azimuth(at?.az)],
];

export function start() {
  const values = FIGURES.map(() => el("dd", {}));
  byId("glance").replaceChildren(...FIGURES.map(([words], index) => el("div", {}, el("dt", {}, words), values[index])));
  subscribe(() => FIGURES.forEach(([, figure], index) => say(values[index], figure(mount()?.position))));
}
