// What the gateway answers, where it can be seen from every view. A refusal stays until it is closed or followed by the
// next answer; what went well goes by itself.

import { button, byId, el } from "../core/dom.js";
import { sentence } from "../core/format.js";

/** Milliseconds after which it goes, and how many a word takes to be read where that is longer. */
const GONE = 4000, WORD = 400;
let timer = 0;

/** @param {string} words @param {"done"|"refused"} [kind] */
export function notice(words, kind = "done") {
  clearTimeout(timer);
  const box = byId("notices");
  if (!words) return box.replaceChildren();
  const close = kind === "refused" ? button("Close", () => box.replaceChildren(), { class: "quiet" }) : null;
  box.replaceChildren(el("div", { class: `notice ${kind}` }, el("p", {}, sentence(words)), close));
  if (kind === "done") timer = setTimeout(() => box.replaceChildren(), Math.max(GONE, words.split(" ").length * WORD));
}

/** What went well before is no news any more. */
export function outdated() {
  byId("notices").querySelector(".notice.done")?.remove();
}

/** Show the answer to a request; returns it. */
export function answered(answer) {
  notice(answer.words, answer.ok ? "done" : "refused");
  return answer;
}
