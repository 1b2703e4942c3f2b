// All readings of the mount, in groups; one row is one value.

import { byId, el } from "../core/dom.js";
import { angle, azimuth, declination, hourAngle, hours, sentence, span, UNKNOWN } from "../core/format.js";
import { mount, subscribe } from "../core/store.js";
import { lineGroup } from "./line.js";
import { programsGroup } from "./programs.js";
import { rows } from "./rows.js";
import { siteGroup } from "./site.js";

const PIERS = { E: "east", W: "west" };
const age = (at) => (at && at.age > 10 ? `${span(at.age)} ago` : "");

/** @type {Array<[string, import("./rows.js").Row[]]>}  title and rows */
const GROUPS = [
  ["Where it points", [
    ["Right ascension", (seen) => hours(seen.position?.ra), "large"],
    ["Declination", (seen) => declination(seen.position?.dec), "large"],
    ["Altitude", (seen) => angle(seen.position?.alt, 2), "large"],
    ["Azimuth", (seen) => azimuth(seen.position?.az), "large"],
    ["RA, J2000", (seen) => hours(seen.position?.ra2000)],
    ["Dec, J2000", (seen) => declination(seen.position?.dec2000)],
    ["Hour angle", (seen) => hourAngle(seen.hour_angle)],
    ["Sidereal time", (seen) => hours(seen.sidereal)],
    ["Side of the pier", (seen) => PIERS[seen.pier] ?? ""],
    ["Seen", (seen) => age(seen.position)],
  ]],
  ["What it does", [
    ["Now", (seen) => seen.does || UNKNOWN],
    ["Ordered", (seen) => seen.wanted.map(sentence).join(" ") || "Nothing.", "words"],
    ["On its way to", (seen) => seen.target?.words ?? ""],
    ["Tracking", (seen) => seen.tracking || UNKNOWN],
    ["Aligned", (seen) => ({ true: "yes", false: "no" })[String(seen.aligned)] ?? UNKNOWN],
  ]],
  ["Mount", [
    ["Found", (seen) => seen.product || "It has not said yet what it is."],
    ["Model", (seen) => seen.model],
    ["Version", (seen) => (seen.version === "?" ? "" : seen.version)],
    ["Reached by", (seen) => seen.at],
  ]],
];

function groupOf(title, described) {
  const figures = rows(described);
  subscribe(() => figures.draw(mount()));
  return el("section", { class: "group" }, el("h3", {}, title), figures.list);
}

/** Refusals and the gateway's own actions in the last minutes, the newest first. */
function latelyGroup() {
  const list = el("ul", { class: "lines" });
  const whole = el("section", { class: "group" }, el("h3", {}, "Lately"), list);
  let before = "";
  subscribe(() => {
    const now = mount()?.lately ?? [];
    whole.hidden = !now.length;
    if (now.join() === before) return;
    before = now.join();
    list.replaceChildren(...now.toReversed().map((words) => el("li", {}, sentence(words))));
  });
  return whole;
}

export function start() {
  const [points, does, what] = GROUPS.map(([title, rows]) => groupOf(title, rows));
  byId("readings").replaceChildren(points, does, latelyGroup(), siteGroup(), lineGroup(), programsGroup(), what);
}
