// What this browser keeps for the observer: favourites, what was seen, a list, the telescope's field.

import { keep, kept } from "../core/kept.js";

const write = (key, value) => keep(key, JSON.stringify(value));
function read(key, otherwise) {
  try {
    return JSON.parse(kept(key)) ?? otherwise;
  } catch {
    return otherwise; // it is not ours
  }
}

/** Names that are marked: `favourites` or `seen`. */
export const isMarked = (mark, name) => read(mark, []).includes(name);
export const marked = (mark) => read(mark, []);
export function toggle(mark, name) {
  write(mark, isMarked(mark, name) ? read(mark, []).filter((one) => one !== name) : [...read(mark, []), name]);
}

/** The observer's own list, as it was pasted: one name or place a line. */
export const ownList = () => read("own-list", "");
export const keepList = (text) => write("own-list", text);

/** Focal lengths of telescope and eyepiece (mm), and the eyepiece's apparent field (degrees). */
export const optics = () => read("optics", null);
export const keepOptics = (value) => write("optics", value);

/** The widest field that is believed, degrees: "1,000" mm would be one of a millimetre. */
const WIDEST = 10;

/** The true field of view, degrees; null if it was not told, or cannot be. */
export function field(told = optics()) {
  const wide = told ? (told.apparent * told.eyepiece) / told.telescope : 0;
  return wide > 0 && wide <= WIDEST ? wide : null;
}
