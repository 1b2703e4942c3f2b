// Shows the gateway's answers in every view. A refusal, and a success that is long or would be cut, stay until the user
// closes them or another answer replaces them; other successes disappear by themselves.

import { BUTTONS } from "../core/labels.js";
import { button, byId, el } from "../core/dom.js";
import { sentence } from "../core/format.js";
import { ask } from "../core/socket.js";

/** Milliseconds for which a success is shown: at least so many, or so many per word if that is longer; letters of a long one. */
const GONE = 4000, WORD = 400, LONG = 60;
/** By so many pixels letters reach beyond a line that is as high as they are. */
const BEYOND = 4;
let timer = 0;

const isCut = (text) => text.scrollHeight > text.clientHeight + BEYOND || text.scrollWidth > text.clientWidth;

/** @param {string} words @param {"done"|"refused"} [kind] */
export function notice(words, kind = "done") {
  clearTimeout(timer);
  const box = byId("notices"), clear = () => box.replaceChildren();
  if (!words) return clear();
  const text = el("p", {}, sentence(words)), made = el("div", { class: `notice ${kind}` }, text);
  box.replaceChildren(made);
  if (kind === "done" && words.length <= LONG && !isCut(text)) {
    timer = setTimeout(clear, Math.max(GONE, words.split(" ").length * WORD));
    return;
  }
  made.className = `notice ${kind === "done" ? "told" : kind}`;
  made.append(button(BUTTONS.close, clear, { class: "quiet" }));
}

/** Remove the notice of an earlier success. */
export function outdated() {
  byId("notices").querySelector(".notice.done")?.remove();
}

/** Remove the refusal of what is looked for anew; one of a stop stays. */
export function settled() {
  const shown = byId("notices").querySelector(".refused");
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
