// All readings of the mount, in groups; one row is one value.

import { HEADINGS, READINGS } from "../core/labels.js";
import { byId, group } from "../core/dom.js";
import { angle, azimuth, declination, hourAngle, hours, sentence, span, UNKNOWN } from "../core/format.js";
import { mount, subscribe } from "../core/store.js";
import { lineGroup } from "./line.js";
import { programsGroup } from "./programs.js";
import { changingList, rows } from "./rows.js";
import { siteGroup } from "./site.js";

const PIERS = { E: "east", W: "west" };
const age = (at) => (at && at.age > 10 ? `${span(at.age)} ago` : "");

/** @type {Array<[string, import("./rows.js").Row[]]>}  title and rows */
const GROUPS = [
  [HEADINGS.points, [
    [READINGS.ra, (seen) => hours(seen.position?.ra), "large"],
    [READINGS.dec, (seen) => declination(seen.position?.dec), "large"],
    [READINGS.alt, (seen) => angle(seen.position?.alt, 2), "large"],
    [READINGS.az, (seen) => azimuth(seen.position?.az), "large"],
    [READINGS.ra2000, (seen) => hours(seen.position?.ra2000), "where"],
    [READINGS.dec2000, (seen) => declination(seen.position?.dec2000), "where"],
    [READINGS.hourAngle, (seen) => hourAngle(seen.hour_angle), "where"],
    [READINGS.sidereal, (seen) => hours(seen.sidereal)],
    [READINGS.pier, (seen) => PIERS[seen.pier] ?? ""],
    [READINGS.age, (seen) => age(seen.position)],
  ]],
  [HEADINGS.does, [
    [READINGS.now, (seen) => seen.does || UNKNOWN],
    [READINGS.ordered, (seen) => seen.wanted.map(sentence).join(" ") || "Nothing.", "words"],
    [READINGS.goal, (seen) => seen.target?.words ?? ""],
    [READINGS.tracking, (seen) => seen.tracking || UNKNOWN],
    [READINGS.aligned, (seen) => ({ true: "yes", false: "no" })[String(seen.aligned)] ?? UNKNOWN],
  ]],
  [HEADINGS.mount, [
    [READINGS.found, (seen) => seen.product || "Not identified yet."],
    [READINGS.model, (seen) => seen.model],
    [READINGS.version, (seen) => (seen.version === "?" ? "" : seen.version)],
    [READINGS.at, (seen) => seen.at],
  ]],
];

function groupOf(title, described) {
  const figures = rows(described);
  subscribe(() => figures.draw(mount()));
  return group(title, figures.list);
}

/** Refusals and the gateway's own actions in the last minutes, the newest first. */
const latelyGroup = () => changingList(HEADINGS.lately, (seen) => seen.lately.map(sentence).toReversed());

export function start() {
  const [points, does, what] = GROUPS.map(([title, rows]) => groupOf(title, rows));
  byId("readings").replaceChildren(points, does, latelyGroup(), siteGroup(), lineGroup(), programsGroup(), what);
}
