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

/** A card with a heading. */
export const group = (title, ...content) => el("section", { class: "group" }, el("h3", {}, title), ...content);

/** Set the text of an element, changing the page only if the text is different. */
export function say(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

/** Whether the user types into this element, so that Space must not stop the mount. */
export const isTyping = (element) =>
  element instanceof HTMLTextAreaElement || (element instanceof HTMLInputElement && element.type !== "range");

const NEXT = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/**
 * A choice between a few values, as large buttons in a row. In a `radiogroup` the arrow keys choose, and Tab reaches the
 * chosen one; in a `group`, for what acts at once, each is a button that is pressed or not.
 * @param {any} box  a `role="radiogroup"` or `role="group"` element
 * @param {Array<[string, string]>} choices  value and words
 * @param {(value: string) => void} chosen
 * @returns {{ set(value: string | null): void }}
 */
export function choice(box, choices, chosen) {
  const radio = box.getAttribute("role") === "radiogroup", state = radio ? "aria-checked" : "aria-pressed";
  const buttons = choices.map(([value, words]) =>
    button(words, () => chosen(value), { role: radio ? "radio" : null, "data-value": value, [state]: "false" }));
  box.replaceChildren(...buttons);
  box.onkeydown = radio ? (event) => {
    const offered = buttons.filter((one) => !one.hidden), from = offered.indexOf(event.target);
    if (!NEXT[event.key] || from < 0) return;
    event.preventDefault();
    const to = offered[(from + NEXT[event.key] + offered.length) % offered.length];
    to.focus();
    to.click();
  } : null;
  return {
    set(value) {
      const any = buttons.some((one) => one.dataset.value === value);
      for (const [index, one] of buttons.entries()) {
        const chosen = one.dataset.value === value;
        if (one.getAttribute(state) !== String(chosen)) one.setAttribute(state, String(chosen));
        if (radio) one.tabIndex = chosen || (!any && index === 0) ? 0 : -1;
      }
    },
  };
}

/**
 * The same for choices that change: they are built again then, and hidden while there is but one.
 * @param {any} box @param {(value: string) => void} chosen
 * @returns {(choices: Array<[string, string]>, value: string) => void}  shows them, and which one is chosen
 */
export function changingChoice(box, chosen) {
  let before = "", made = null;
  return (choices, value) => {
    if (JSON.stringify(choices) !== before) {
      before = JSON.stringify(choices);
      box.hidden = choices.length < 2;
      made = choice(box, choices, chosen);
    }
    made.set(value);
  };
}
