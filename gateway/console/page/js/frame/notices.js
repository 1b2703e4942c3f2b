// Shows the gateway's answers in every view. A refusal stays until the user closes it or another answer replaces it;
// a success disappears by itself.

import { BUTTONS } from "../core/labels.js";
import { button, byId, el } from "../core/dom.js";
import { sentence } from "../core/format.js";
import { ask } from "../core/socket.js";

/** Milliseconds for which a success is shown: at least so many, or so many per word if that is longer. */
const GONE = 4000, WORD = 400;
let timer = 0;

/** @param {string} words @param {"done"|"refused"} [kind] */
export function notice(words, kind = "done") {
  clearTimeout(timer);
  const box = byId("notices");
  if (!words) return box.replaceChildren();
  const close = kind === "refused" ? button(BUTTONS.close, () => box.replaceChildren(), { class: "quiet" }) : null;
  box.replaceChildren(el("div", { class: `notice ${kind}` }, el("p", {}, sentence(words)), close));
  if (kind === "done") timer = setTimeout(() => box.replaceChildren(), Math.max(GONE, words.split(" ").length * WORD));
}

/** Remove the notice of an earlier success. */
export function outdated() {
  byId("notices").querySelector(".notice.done")?.remove();
}

/** Remove the refusal of what is looked for anew; one of a stop stays. */
export function settled() {
  const shown = byId("notices").firstElementChild;
  if (shown && !/STOP/.test(shown.textContent)) shown.remove();
}

/** Show the answer to a request; returns it. */
export function answered(answer) {
  notice(answer.words, answer.ok ? "done" : "refused");
  return answer;
}

/** Ask for something and show the answer, with these `words` if it was done; returns the gateway's. */
export async function order(request, words = "") {
  const answer = await ask(request);
  answered(answer.ok && words ? { ...answer, words } : answer);
  return answer;
}
