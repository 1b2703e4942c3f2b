// Creates elements. All text from outside becomes a text node here; nothing is ever parsed as markup.

/** @param {string} id @returns {any} the element with this id, which must be in index.html */
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

/** A button that calls a function when it is clicked, tapped or activated by a key. */
export const button = (words, does, attributes = {}) => el("button", { type: "button", on: { click: does }, ...attributes }, words);

/** Set the text of an element, changing the page only if the text is different. */
export function say(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

/** Whether the user types into this element, so that Space must not stop the mount. */
export const isTyping = (element) =>
  element instanceof HTMLTextAreaElement || (element instanceof HTMLInputElement && element.type !== "range");

/**
 * A choice between a few values, as large buttons in a row.
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
