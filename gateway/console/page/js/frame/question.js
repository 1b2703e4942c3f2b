// Asks before something is done that cannot be taken back. While it waits, STOP can be pressed as ever.

import { byId, el, say } from "../core/dom.js";

/**
 * @param {{title: string, words: string, yes: string, fields?: Array<{name: string, label: string, value?: string, type?: string}>}} question
 * @returns {Promise<Record<string, string> | null>} what was typed into the fields; null where it was cancelled
 */
export function question({ title, words, yes, fields = [] }) {
  const dialog = byId("ask");
  const inputs = fields.map((field) =>
    el("input", { id: `ask-${field.name}`, name: field.name, type: field.type ?? "text", value: field.value ?? "", autocomplete: "off" }));
  say(byId("ask-title"), title);
  say(byId("ask-words"), words);
  say(byId("ask-yes"), yes);
  byId("ask-fields").replaceChildren(
    ...fields.flatMap((field, index) => [el("label", { for: `ask-${field.name}` }, field.label), inputs[index]]));
  const before = document.activeElement;
  dialog.close();
  return new Promise((resolve) => {
    let answer = null;
    byId("ask-no").onclick = () => dialog.close();
    dialog.querySelector("form").onsubmit = (event) => {
      event.preventDefault();
      answer = Object.fromEntries(inputs.map((input) => [input.name, input.value.trim()]));
      dialog.close();
    };
    dialog.onkeydown = (event) => {
      if (event.key === "Escape") dialog.close();
    };
    dialog.onclose = () => {
      document.querySelector("main").inert = false;
      before?.focus();
      resolve(answer);
    };
    // Not showModal: that would take STOP away from the finger.
    document.querySelector("main").inert = true;
    dialog.show();
    (inputs[0] ?? byId("ask-no")).focus();
  });
}
