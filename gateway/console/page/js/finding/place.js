// The card of a chosen position: its altitude, when it rises and sets, whether the mount may go there and if not, why.
// One more press starts the goto; a sync asks first, because it changes the position that the mount believes in.

import { button, byId, el, say } from "../core/dom.js";
import { angle, azimuth, declination, hours, timeOfDay } from "../core/format.js";
import { answered, notice } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { ask } from "../core/socket.js";
import { mount, state, subscribe } from "../core/store.js";
import { show } from "../core/views.js";

const RENEW = 15000;
/** The chosen position: the request for it, and its answer. @type {{request: any, found: any} | null} */
let chosen = null;
let drawn = "";
const listeners = [];

/** Subscribe to changes of the chosen position (null: none). */
export const onPlace = (listener) => listeners.push(listener);
export const place = () => chosen?.found ?? null;

/** The target of a goto or sync: the name if there is one, so that the Moon's motion is followed. */
const aim = () => (chosen.request.name ? { name: chosen.request.name } : { ra: chosen.request.ra, dec: chosen.request.dec, j2000: true });

export const showName = (name) => look({ do: "look_up", name }, name);

/** Choose a J2000 position that was tapped or typed. */
export const showPlace = ({ ra2000, dec2000 }, name = "") => look({ do: "ask", ra: ra2000, dec: dec2000, j2000: true }, name);

/** Choose what was tapped in the chart: by its name if the gateway knows that, because some objects move. */
export async function showPicked(picked) {
  if (!picked.name || !(await look({ do: "look_up", name: picked.name }, picked.name, () => {}))) showPlace(picked, picked.name);
}

async function look(request, name, refused = (words) => notice(words, "refused")) {
  const answer = await ask(request);
  if (!answer.ok) {
    refused(answer.words);
    return false;
  }
  chosen = { request, found: { ...answer, name: answer.name ?? name } };
  show("sky");
  draw();
  listeners.forEach((listener) => listener(chosen.found));
  return true;
}

export function forget() {
  chosen = null;
  draw();
  listeners.forEach((listener) => listener(null));
}

async function go() {
  if (onItsWay()) return;
  const name = chosen.found.name;
  const answer = await ask({ do: "goto", ...aim() });
  answered(answer.ok && name ? { ...answer, words: `It goes to ${name}` } : answer);
}

/** A goto leads to the chosen position if its target is this close, degrees. */
const SAME = 0.05;

/** Whether the telescope is already slewing there. */
function onItsWay() {
  const seen = mount(), found = chosen?.found;
  if (!seen?.slewing || !found || seen.target?.ra2000 == null) return false;
  const aside = ((seen.target.ra2000 - found.ra2000 + 540) % 360) - 180;
  return Math.hypot(aside * Math.cos((found.dec2000 * Math.PI) / 180), seen.target.dec2000 - found.dec2000) < SAME;
}

export async function sync() {
  if (!chosen) return notice("Choose in the sky, or find by name, what the telescope points at; then sync.", "refused");
  const name = chosen.found.name || "this place";
  const agreed = await question({
    title: `Sync on ${name}?`, yes: "It is centred: sync",
    words: `The mount will believe that it points at ${name} now, and every later goto builds on that. Do it only while ${name} is in the middle of the eyepiece.`,
  });
  if (agreed) answered(await ask({ do: "sync", ...aim() }));
}

/** Label and local time of the next rising or setting, relative to the lowest allowed altitude. */
function nextEvent(found) {
  const lowest = mount()?.limits.lowest ?? 0;
  const [sets, rises] = lowest > 0 ? [`Above ${lowest}° until`, `Above ${lowest}° from`] : ["Sets", "Rises"];
  if (found.alt === null) return [sets, "site unknown"];
  if (found.sets === null) return found.alt > lowest ? (lowest > 0 ? [`Above ${lowest}°`, "always"] : [sets, "never"]) : [rises, "never"];
  return found.sets < found.rises ? [sets, timeOfDay(found.sets)] : [rises, timeOfDay(found.rises)];
}

const kindOf = (found) =>
  [found.kind, Number.isFinite(found.magnitude) ? `magnitude ${found.magnitude.toFixed(1)}` : ""].filter(Boolean).join(", ");

function card(found) {
  const may = state.act && found.may;
  const [event, when] = nextEvent(found);
  return [
    el("header", {},
      el("div", {}, el("h3", {}, found.name || "Chosen place"), el("p", { class: "kind" }, kindOf(found) || `${hours(found.ra2000)}  ${declination(found.dec2000)}`)),
      button("×", forget, { class: "quiet close", "aria-label": "Close" })),
    el("dl", { class: "figures" },
      el("div", {}, el("dt", {}, "Altitude"), el("dd", {}, angle(found.alt))),
      el("div", {}, el("dt", {}, "Azimuth"), el("dd", {}, azimuth(found.az))),
      el("div", {}, el("dt", {}, event), el("dd", {}, when))),
    found.may ? null : el("p", { class: "why" }, found.why),
    el("div", { class: "buttons" },
      button("Go there", go, { class: "primary", id: "go", disabled: !may }),
      button("Sync here…", sync, { id: "sync", disabled: !state.act })),
  ].filter(Boolean);
}

function draw() {
  const box = byId("place");
  const key = JSON.stringify([chosen?.found ?? null, state.act]);
  if (key !== drawn) redraw(box, key);
  if (chosen) tellWay(byId("go"), onItsWay());
}

/** Update the card in place, because a button that is replaced under a finger is not pressed. */
function tellWay(goes, going) {
  say(goes, going ? "On its way…" : "Go there");
  goes.setAttribute("aria-disabled", String(going));
}

function redraw(box, key) {
  drawn = key;
  // Keep the focus on its button when the values are updated.
  const focused = box.contains(document.activeElement) ? document.activeElement.id : "";
  box.hidden = !chosen;
  document.body.classList.toggle("has-place", Boolean(chosen));
  box.replaceChildren(...(chosen ? card(chosen.found) : []));
  if (focused) byId(focused)?.focus();
}

async function renew() {
  if (!chosen || document.hidden) return;
  const { request, found } = chosen;
  const answer = await ask(request);
  if (!answer.ok || chosen?.request !== request) return;
  chosen.found = { ...answer, name: answer.name ?? found.name };
  draw();
}

/** The parts of the mount's state that affect the verdict: after a change the card is requested again at once. */
const verdictOf = (seen) => seen && JSON.stringify([seen.index, seen.state, seen.held, seen.asleep, seen.aligned, seen.limits]);

export function start() {
  let before = null;
  setInterval(renew, RENEW);
  subscribe(() => {
    draw();
    const now = verdictOf(mount());
    if (now !== before) renew();
    before = now;
  });
}
