// Search for an object: suggestions while the user types; coordinates can be typed too. What they may mean, if that is
// more than one thing, is offered in the place of the suggestions.

import { BUTTONS } from "../core/labels.js";
import { button, byId, el, say } from "../core/dom.js";
import { notice, settled } from "../frame/notices.js";
import { forget, onPlace, showName, showTyped, typing } from "./place.js";
import { typedPlace } from "./typed.js";
import { ask } from "../core/socket.js";

const PATIENCE = 120;
let timer = 0;
let marked = -1;
let latest = 0;
/** What stands in the field when a card is shown. */
let own = "";

function close() {
  byId("suggestions").hidden = true;
  byId("suggestions").replaceChildren();
  byId("object").setAttribute("aria-expanded", "false");
  byId("object").removeAttribute("aria-activedescendant");
  marked = -1;
}

/** Look up a name, or coordinates that can be meant in one way; whatever comes of it, the last target is none any more. */
export function take(text) {
  clearTimeout(timer);
  latest++;
  forget();
  settled();
  byId("object").value = text;
  const place = typedPlace(text);
  say(byId("asks"), place?.asks ?? "");
  if (place?.asks) {
    byId("object").focus();
    return offer(place.choices);
  }
  close();
  byId("object").blur();
  if (place) showTyped(place);
  else showName(text, (words) => suggestInstead(text, words));
}

/** Offer the names that are like an unknown one; if there are none, say only that it is unknown. */
async function suggestInstead(text, words) {
  const mine = ++latest;
  const { found = [] } = await ask({ do: "search", text });
  if (mine !== latest) return;
  if (!found.length) return notice(words, "refused");
  say(byId("asks"), found.length > 1 ? "Did you mean one of these?" : "Did you mean this?");
  byId("object").focus();
  offer(found);
}

function offer(names) {
  const list = byId("suggestions");
  list.replaceChildren(...names.map((name, index) =>
    el("li", { role: "option", id: `suggestion-${index}`, "aria-selected": "false", on: { pointerdown: (event) => { event.preventDefault(); take(name); } } }, name)));
  list.hidden = names.length === 0;
  marked = -1;
  byId("object").setAttribute("aria-expanded", String(names.length > 0));
}

async function suggest() {
  const mine = ++latest;
  const text = byId("object").value.trim();
  const place = typedPlace(text);
  say(byId("asks"), "");
  if (!text || (place && !place.choices)) return close();
  if (place) return offer(place.choices);
  const answer = await ask({ do: "search", text });
  if (mine === latest && document.activeElement === byId("object")) offer(answer.found ?? []);
}

/** Mark the next or the previous suggestion; null marks none. */
function mark(step) {
  const options = [...byId("suggestions").children];
  if (!options.length) return;
  marked = step === null ? -1 : (Math.max(marked, step > 0 ? -1 : 0) + step + options.length) % options.length;
  options.forEach((option, index) => option.setAttribute("aria-selected", String(index === marked)));
  if (marked < 0) return byId("object").removeAttribute("aria-activedescendant");
  options[marked].scrollIntoView({ block: "nearest" });
  byId("object").setAttribute("aria-activedescendant", options[marked].id);
}

function keys(event) {
  if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    event.preventDefault();
    mark(event.key === "ArrowDown" ? 1 : -1);
  } else if (event.key === "Escape") close();
}

function submit(event) {
  event.preventDefault();
  const option = byId("suggestions").children[marked];
  const text = option ? option.textContent : byId("object").value.trim();
  if (!text) return notice("Type a name, like M 31, Vega or Jupiter.", "refused");
  take(text);
}

export function start() {
  const input = byId("object");
  byId("search").after(el("p", { id: "asks", class: "asks", role: "status" }));
  input.addEventListener("input", () => {
    clearTimeout(timer);
    mark(null); // the marked suggestion belonged to another text
    typing(input.value.trim() !== own && input.value.trim() !== "");
    timer = setTimeout(suggest, PATIENCE);
  });
  input.addEventListener("focus", () => input.select());
  onPlace((place) => {
    if (place?.name) input.value = place.name;
    own = input.value.trim();
  });
  input.addEventListener("keydown", keys);
  input.addEventListener("blur", close);
  byId("search").addEventListener("submit", submit);
  // The list is loaded when somebody wants it: with the catalogue it is as large as the rest of the page.
  const openList = () => import("./list.js").then((list) => list.toggle(take), () => notice("The list could not be loaded.", "refused"));
  byId("search").append(button(BUTTONS.tonight, openList, { id: "tonight-button", "aria-pressed": "false" }));
}
