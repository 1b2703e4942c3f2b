// The altitude of a place through the night as a small picture, with Sun and Moon and the present time.

import { timeOfDay } from "../core/format.js";
import { angles } from "../sky/sphere.js";

const WIDE = 320, HIGH = 84, FOOT = 14, STEP = 1200;
/** The altitudes of the Sun between which the sky gets dark, and how dark each is drawn. */
const TWILIGHT = [[0, 0.35], [-12, 0.6], [-18, 1]];

function svg(tag, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

/** @param {{ra2000: number, dec2000: number}} place @param {import("./tonight.js").Night} night */
export function curve(place, night, sceneAt, now, lowest) {
  const x = (unix) => ((unix - night.begins) / (night.ends - night.begins)) * WIDE;
  const y = (altitude) => HIGH - (Math.max(altitude, -2) / 90) * HIGH;
  const times = Array.from({ length: Math.round((night.ends - night.begins) / STEP) + 1 }, (_, index) => night.begins + index * STEP);
  const scenes = times.map(sceneAt);
  const line = (name, altitude) =>
    svg("polyline", { class: name, points: times.map((unix, index) => `${x(unix).toFixed(1)},${y(altitude(unix, scenes[index])).toFixed(1)}`).join(" ") });
  const dark = times.slice(0, -1).map((unix, index) => {
    const sun = night.altitude("sun", unix, scenes[index]), shade = TWILIGHT.filter(([below]) => sun < below).at(-1)?.[1] ?? 0;
    return svg("rect", { class: "dark", x: x(unix).toFixed(1), y: 0, width: (x(STEP + night.begins) + 0.3).toFixed(1), height: HIGH, "fill-opacity": shade });
  });
  const hour = 3600, first = Math.ceil(night.begins / hour) * hour;
  const marks = Array.from({ length: 5 }, (_, index) => first + (index * 4 - (new Date(first * 1000).getHours() % 2)) * hour).filter((unix) => x(unix) > 18 && x(unix) < WIDE - 18);
  const own = (unix, scene) => angles(scene.place(place.ra2000, place.dec2000))[1];
  const highest = times.reduce((best, unix, index) => Math.max(best, own(unix, scenes[index])), -90);
  return svg("svg", { class: "curve", viewBox: `0 0 ${WIDE} ${HIGH + FOOT}`, role: "img", "aria-label": `Altitude through the night, at most ${Math.round(highest)}°; the Moon dashed, the Sun dotted` },
    ...dark,
    svg("line", { class: "limit", x1: 0, x2: WIDE, y1: y(lowest), y2: y(lowest) }),
    line("sun", (unix, scene) => night.altitude("sun", unix, scene)),
    line("moon", (unix, scene) => night.altitude("moon", unix, scene)),
    line("own", own),
    ...(now > night.begins && now < night.ends ? [svg("line", { class: "now", x1: x(now), x2: x(now), y1: 0, y2: HIGH })] : []),
    ...marks.map((unix) => svg("text", { x: x(unix).toFixed(1), y: HIGH + FOOT - 3 }, timeOfDay(unix))));
}
