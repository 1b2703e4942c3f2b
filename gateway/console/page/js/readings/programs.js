// The connected programs: address, surface, last command, and commands per second; without any, where one connects.

import { HEADINGS } from "../core/labels.js";
import { el } from "../core/dom.js";
import { changingList } from "./rows.js";

const nobody = (surfaces) =>
  ["No program is connected. One connects to ", ...surfaces.flatMap((at, index) => [index ? " or " : "", el("code", {}, at.split("@")[1] ?? at)]), "."];

const row = (program) => [
  el("b", {}, program.name),
  el("span", {}, [program.profile, program.surface.split("@")[0], program.read_only ? "only looks" : ""].filter(Boolean).join(" · ")),
  el("span", {}, `${program.rate.toFixed(1)} commands a second${program.last ? ", last " : ""}`, program.last ? el("code", {}, program.last) : null),
];

export const programsGroup = () => changingList(
  HEADINGS.programs, (seen) => (seen.programs.length ? seen.programs : [seen.surfaces]), "",
  { line: (one) => (Array.isArray(one) ? nobody(one) : row(one)), style: "programs" });
