// Making elements. Everything that comes from outside becomes a text node here: nothing is ever parsed as markup.

/** @param {string} id @returns {any} The element of that id, which index.html is sure to have. */
export const byId = (id) => document.getElementById(id);

/**
 * @param {string} tag
 * @param {Record<string, any>} [attributes] `class`, `on` (event name -> listener), and attributes; null leaves one out.
 * @param {...(Node|string|number|null)} children
 * @returns {any}
 */
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) made.addEventListener(event, listener);
    } else if (value !== null && value !== false) {
      made.setAttribute(name, value === true ? "" : String(value));
    }
  }
  made.append(...children.filter((child) => child !== null).map((child) => (child instanceof Node ? child : String(child))));
  return made;
}

/** A button that does something when it is clicked, tapped or entered. */
export const button = (words, does, attributes = {}) => el("button", { type: "button", on: { click: does }, ...attributes }, words);

/** Say something in an element, touching the page only where that is new. */
export function say(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

/** Whether somebody types into this element, so that a space is a space. */
export const isTyping = (element) =>
  element instanceof HTMLTextAreaElement || (element instanceof HTMLInputElement && element.type !== "range");

/**
 * One choice out of a few, as large buttons in a row.
 * @param {any} box  a `role="radiogroup"` element
 * @param {Array<[string, string]>} choices  value and words
 * @param {(value: string) => void} chosen
 * @returns {{ set(value: string | null): void }}
 */
export function choice(box, choices, chosen) {
  const buttons = choices.map(([value, words]) =>
    button(words, () => chosen(value), { role: "radio", "data-value": value, "aria-checked": "false" }));
  box.replaceChildren(...buttons);
  return {
    set(value) {
      for (const one of buttons) {
        const checked = String(one.dataset.value === value);
        if (one.getAttribute("aria-checked") !== checked) one.setAttribute("aria-checked", checked);
      }
    },
  };
}
