// The lower part of a target's card: what there is to see, whether it fits the field, its night, and the observer's marks.

import { BUTTONS, HEADINGS } from "../core/labels.js";
import { button, el } from "../core/dom.js";
import { notice } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { gatewayNow, mount, skyAt } from "../core/store.js";
import { curve } from "./curve.js";
import { field, isMarked, keepOptics, optics, toggle } from "./kept.js";
import { night, nightNow } from "./night.js";

/** A target fits if so much of the field holds it. */
const FITS = 0.9;
const LEGEND = "— altitude  ‑ ‑ Moon  ··· Sun";

/** 69.7 -> 70′, 1.4 -> 1.4′ */
const minutes = (value) => `${value < 10 ? value.toFixed(1) : Math.round(value)}′`;
export const sizeOf = ({ size, width }) => (size ? [size, width].filter(Boolean).map(minutes).join(" × ") : "");

export async function askOptics(again = () => {}) {
  const told = optics() ?? {};
  const fields = [["telescope", "Focal length of the telescope, mm"], ["eyepiece", "Focal length of the eyepiece, mm"], ["apparent", "Apparent field of the eyepiece, degrees"]];
  const given = await question({
    title: HEADINGS.field, yes: BUTTONS.keep, words: "Saved in this browser; each target then shows whether it fits. The spiral search uses it as its step.",
    fields: fields.map(([name, label]) => ({ name, label, value: told[name] ? String(told[name]) : "" })),
  });
  if (!given) return;
  const values = Object.fromEntries(fields.map(([name]) => [name, Number(given[name].replace(",", "."))]));
  if (!Object.values(values).every((value) => value > 0) || values.apparent > 180) return notice("Write three numbers, like 1000, 25 and 60.", "refused");
  if (field(values) === null) return notice("That would be a field of more than 10°. Write three numbers, like 1000, 25 and 60.", "refused");
  keepOptics(values);
  again();
}

function fits({ size }) {
  const wide = field();
  if (!wide) return "";
  const view = `Field ${wide < 1 ? minutes(wide * 60) : `${wide.toFixed(1)}°`}`;
  return size ? `${view}: ${size <= FITS * wide * 60 ? "it fits" : "it is larger"}` : view;
}

/** @param {any} found what the gateway knows of it @param {() => void} again draws the card again */
export function details(found, again) {
  if (!night()) nightNow().then((known) => known && again());
  const name = found.name;
  const mark = (key, label, done) =>
    button(isMarked(key, name) ? done : label, () => (toggle(key, name), again()), { class: "chip", id: `mark-${key}`, "aria-pressed": String(isMarked(key, name)) });
  return el("div", { class: "details" },
    found.seen ? el("p", { class: "kind" }, found.seen) : null,
    night() && skyAt(0).sky ? curve(found, night(), skyAt, gatewayNow(), mount().limits.lowest) : null,
    night() && skyAt(0).sky ? el("p", { class: "legend" }, LEGEND) : null,
    el("div", { class: "marks" },
      button(fits(found) || BUTTONS.field, () => askOptics(again), { class: "chip", id: "field" }),
      ...(found.kind && name ? [mark("favourites", BUTTONS.favourite, BUTTONS.isFavourite), mark("seen", BUTTONS.seen, BUTTONS.isSeen)] : [])));
}
