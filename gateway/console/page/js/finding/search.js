// Search for an object: suggestions while the user types; J2000 right ascension and declination can be typed too.

import { byId, el } from "../core/dom.js";
import { notice } from "../frame/notices.js";
import { showName, showPlace } from "./place.js";
import { ask } from "../core/socket.js";

const PATIENCE = 120;
let timer = 0;
let marked = -1;
let latest = 0;

/** `05:34:32 +22:00:52`, `5h34m +22d`, or degrees `83.6 22.01` -> a J2000 position in degrees, else null. */
export function typedPlace(text) {
  const found = /^\s*(\d[\d.:hms ]*?)[\s,]+([+\-−]?\d[\d.:°d'′m"″s ]*)$/i.exec(text);
  if (!found) return null;
  const numbers = (part) => part.match(/\d+(\.\d+)?/g)?.map(Number) ?? [];
  const value = (list) => list[0] + (list[1] ?? 0) / 60 + (list[2] ?? 0) / 3600;
  const first = numbers(found[1]);
  const inDegrees = first.length === 1 && !/h/i.test(found[1]);
  const ra = value(first) * (inDegrees ? 1 : 15);
  const dec = value(numbers(found[2])) * (/^[-−]/.test(found[2]) ? -1 : 1);
  return ra >= 0 && ra <= 360 && Math.abs(dec) <= 90 ? { ra2000: ra, dec2000: dec } : null;
}

function close() {
  byId("suggestions").hidden = true;
  byId("suggestions").replaceChildren();
  byId("object").setAttribute("aria-expanded", "false");
  byId("object").removeAttribute("aria-activedescendant");
  marked = -1;
}

function take(name) {
  clearTimeout(timer);
  latest++;
  byId("object").value = name;
  close();
  byId("object").blur();
  showName(name);
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
  if (!text || typedPlace(text)) return close();
  const answer = await ask({ do: "search", text });
  if (mine === latest && document.activeElement === byId("object")) offer((answer.found ?? []).map((one) => one.name));
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
  const place = typedPlace(text);
  if (!place) return take(text);
  close();
  showPlace(place);
}

export function start() {
  const input = byId("object");
  input.addEventListener("input", () => {
    clearTimeout(timer);
    mark(null); // the marked suggestion belonged to another text
    timer = setTimeout(suggest, PATIENCE);
  });
  input.addEventListener("keydown", keys);
  input.addEventListener("blur", close);
  byId("search").addEventListener("submit", submit);
}
