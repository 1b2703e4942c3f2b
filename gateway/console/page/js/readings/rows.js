// Values with their labels; a row with an empty value is hidden. Lists, which are drawn again when they change.

import { el, group, say } from "../core/dom.js";
import { UNKNOWN } from "../core/format.js";
import { mount, subscribe } from "../core/store.js";

/**
 * A group with a list. `lines` are those for a mount's state, text or what `line` makes an item's content of; without
 * any it shows `none`, or nothing at all if that is empty.
 */
export function changingList(title, lines, none = "", { line = (words) => [words], style = "lines", below = [] } = {}) {
  const box = el("ul", { class: style }), whole = group(title, box, ...below);
  let before = "";
  subscribe(() => {
    const now = mount() ? lines(mount()) : [];
    if (JSON.stringify(now) === before) return;
    before = JSON.stringify(now);
    whole.hidden = !now.length && !none;
    box.replaceChildren(...(now.length ? now.map((one) => el("li", {}, ...line(one))) : [el("li", {}, none)]));
  });
  return whole;
}

/** @typedef {[string, (seen: any) => string, ("large"|"where"|"words")?]} Row  label, value for a mount's state, style */

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
