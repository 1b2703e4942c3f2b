// Values with their labels; a row with an empty value is hidden.

import { el, say } from "../core/dom.js";
import { UNKNOWN } from "../core/format.js";

/** @typedef {[string, (seen: any) => string, ("large"|"words")?]} Row  label, value for a mount's state, style */

/** @param {Row[]} described @returns {{list: any, draw(seen: any): void}} `seen` is null before the first state */
export function rows(described) {
  const made = described.map(([label, figure, style]) => {
    const value = el("dd", {});
    return { figure, value, row: el("div", { class: style ?? null }, el("dt", {}, label), value) };
  });
  return {
    list: el("dl", {}, ...made.map(({ row }) => row)),
    draw(seen) {
      for (const { figure, value, row } of made) {
        const words = seen ? figure(seen) : UNKNOWN;
        row.hidden = words === "";
        say(value, words);
      }
    },
  };
}
