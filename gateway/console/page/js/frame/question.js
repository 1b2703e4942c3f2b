// Asks for confirmation before an action that cannot be undone. STOP can be pressed meanwhile.

import { byId, el, say } from "../core/dom.js";

/**
 * @param {{title: string, words: string, yes: string, fields?: Array<{name: string, label: string, value?: string, type?: string}>}} question
 * @returns {Promise<Record<string, string> | null>} the values of the fields; null if the user has cancelled
 */
export function question({ title, words, yes, fields = [] }) {
  const dialog = byId("ask");
  const inputs = fields.map((field) =>
    el("input", { id: `ask-${field.name}`, name: field.name, type: field.type ?? "text", value: field.value ?? "", autocomplete: "off" }));
  say(byId("ask-title"), title);
  say(byId("ask-words"), words);
  say(byId("ask-yes"), yes);
  byId("ask-fields").replaceChildren(...fields.map((field, index) => el("label", {}, field.label, inputs[index])));
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
    // Not showModal: that would block STOP.
    document.querySelector("main").inert = true;
    dialog.show();
    (inputs[0] ?? byId("ask-no")).focus();
  });
}
