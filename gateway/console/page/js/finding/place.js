// The card of a chosen position: its altitude, when it rises and sets, whether the mount may go there and if not, why.
// One more press starts the goto; a sync asks first, because it changes the position that the mount believes in.

import { BUTTONS, HEADINGS, NAMES, READINGS } from "../core/labels.js";
import { button, byId, el, say } from "../core/dom.js";
import { angle, azimuth, declination, hours, magnitude, timeOfDay, zone } from "../core/format.js";
import { notice, order } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { ask } from "../core/socket.js";
import { gatewayNow, mount, skyAt, state, subscribe } from "../core/store.js";
import { culmination } from "./tonight.js";
import { separation, vector } from "../sky/sphere.js";
import { show } from "../core/views.js";

const RENEW = 15000;
/** The chosen position: the request for it, its answer, and whether the telescope is there. @type {{request: any, found: any, there?: boolean} | null} */
let chosen = null;
/** The number of the newest look-up: the answer to an earlier one is dropped. */
let newest = 0;
let drawn = "";
/** Whether another text was typed since, which was not looked up yet: nothing is started under it. */
let other = false;
const listeners = [];

/** Subscribe to changes of the chosen position (null: none). */
export const onPlace = (listener) => listeners.push(listener);
export const place = () => chosen?.found ?? null;

/** The target of a goto or sync: the name if there is one, so that the Moon's motion is followed. */
const aim = () => (({ name, ra, dec, j2000 }) => (name ? { name } : { ra, dec, j2000 }))(requestNow(chosen.request));

/** A request as it is sent: an altitude and azimuth are the place of the sky that is there now. */
function requestNow({ alt, az, typed, ...request }) {
  if (alt === undefined) return request;
  const [ra, dec] = skyAt(gatewayNow()).ofDateAt(az, alt);
  return { ...request, ra, dec, j2000: false };
}

export const showName = (name, refused) => look({ do: "look_up", name }, name, refused);

/** Choose what was typed as numbers: of date unless J2000 was written with it; the card changes that. */
export function showTyped(place) {
  if ("ra" in place) return look({ do: "ask", ...place, j2000: place.j2000 ?? false, typed: true }, "");
  if (!skyAt(0).ofDate) return notice("Altitude and azimuth need the site of the mount, which is not known yet.", "refused");
  return look({ do: "ask", ...place }, `Alt ${angle(place.alt)}, Az ${angle(place.az)}`);
}

/** Choose a J2000 position that was tapped. */
const showPlace = ({ ra2000, dec2000 }, name = "") => look({ do: "ask", ra: ra2000, dec: dec2000, j2000: true }, name);

export function typing(another) {
  other = another;
  draw();
}

/** Choose what was tapped in the chart: by its name if the gateway knows that, because some objects move. */
export async function showPicked(picked) {
  byId("object").value = "";
  if (!picked.name || !(await look({ do: "look_up", name: picked.name }, picked.name, () => {}))) showPlace(picked, picked.name);
}

/** Look something up. Until the answer is there nothing is chosen: what was, cannot be started under a new name. */
async function look(request, name, refused = (words) => notice(words, "refused")) {
  const mine = ++newest;
  chosen = null;
  draw();
  const answer = await ask(requestNow(request));
  if (mine !== newest) return true;
  if (!answer.ok) {
    forget();
    refused(answer.words);
    return false;
  }
  chosen = { request, found: called(answer, name) };
  other = false;
  show("sky");
  if (!lower) import("./details.js").then((loaded) => ((lower = loaded), again()), () => {});
  draw();
  listeners.forEach((listener) => listener(chosen.found));
  return true;
}

/** What was found, under the name by which it was asked for. */
function called(answer, asked) {
  const names = [answer.name ?? asked, ...(answer.also ? answer.also.split(", ") : [])];
  const name = names.find((one) => one.toLowerCase() === asked.toLowerCase()) ?? names[0];
  return { ...answer, name, also: names.filter((one) => one !== name).join(", ") };
}

export function forget() {
  chosen = null;
  draw();
  listeners.forEach((listener) => listener(null));
}

async function go() {
  if (asked || onItsWay()) return;
  const name = chosen.found.name;
  asked = true;
  draw();
  await order({ do: "goto", ...aim() }, name && `It goes to ${name}`);
  asked = false;
  draw();
}

/** Whether a goto was asked for and not answered yet. */
let asked = false;

/** The telescope is at the chosen position if it is this close, degrees; so far it stays there while it is centred by hand; a goto
 * leads there if its target is this close: a step of a minute of arc leads elsewhere. */
const SAME = 0.05, CENTRED = 0.5, GOAL = 0.01;

/** Whether the telescope is already slewing there. */
function onItsWay() {
  const seen = mount(), found = chosen?.found;
  if (!seen?.slewing || !found || seen.target?.ra2000 == null) return false;
  return apartFrom(seen.target) < GOAL;
}

/** How far what is chosen is from another place, degrees. */
const apartFrom = (at) => separation(vector(at.ra2000, at.dec2000), vector(chosen.found.ra2000, chosen.found.dec2000));

/** Whether the mount rests, or tracks, and has told where; at an arrival it is asked once more, and meanwhile it has not. */
const isSettled = (seen) => seen?.position?.ra2000 != null && seen.aligned !== null && !seen.moves;

/** Whether the telescope points at what is chosen, by its mount; as before while that is read again, or it is moved by hand. */
function isThere() {
  const seen = mount();
  if (seen?.slewing) chosen.there = false;
  else if (isSettled(seen)) chosen.there = seen.aligned && apartFrom(seen.position) < (chosen.there ? CENTRED : SAME);
  return Boolean(chosen.there);
}

/** How far what is chosen is from where the mount believes that it points. */
function aside() {
  const at = mount()?.position;
  if (at?.ra2000 == null) return "";
  const apart = apartFrom(at);
  return `It is ${apart < 1 ? `${(apart * 60).toFixed(1)}′` : angle(apart)} from where the mount believes that it points. `;
}

const MOVES = "The mount moves: sync when it has arrived, and what you chose is in the middle of the eyepiece.";

export async function sync() {
  if (!chosen || other) return notice("Choose in the sky, or find by name, what the telescope points at; then sync.", "refused");
  if (mount()?.moves) return notice(MOVES, "refused");
  const name = chosen.found.name || "this place";
  const agreed = await question({
    title: `Sync on ${name}?`, yes: BUTTONS.centred,
    words: `${aside()}The mount will believe that it points at ${name} now, and every later goto builds on that. Do it only while ${name} is in the middle of the eyepiece.`,
  });
  if (agreed && mount()?.moves) notice(MOVES, "refused");
  else if (agreed) order({ do: "sync", ...aim() }, `Synced on ${name}`);
}

const withZone = (unix) => `${timeOfDay(unix)} ${zone(unix)}`;

/** When it next stands in the meridian, and how high. */
function culminates(found) {
  if (!skyAt(0).sky) return "site unknown";
  const { unix, altitude } = culmination(found.ra2000, found.dec2000, gatewayNow(), skyAt);
  return `${withZone(unix)}, ${angle(altitude, 0)}`;
}

/** Label and local time of the next rising or setting, relative to the lowest allowed altitude. */
function nextEvent(found) {
  const lowest = mount()?.limits.lowest ?? 0;
  const [sets, rises] = lowest > 0 ? [`Above ${lowest}° until`, `Above ${lowest}° from`] : [READINGS.sets, READINGS.rises];
  if (found.alt === null || !skyAt(0).sky) return [sets, "site unknown"];
  const next = culmination(found.ra2000, found.dec2000, gatewayNow(), skyAt, Math.max(lowest, 0));
  if (next.sets === null) return found.alt > lowest ? (lowest > 0 ? [`Above ${lowest}°`, "always"] : [sets, "never"]) : [rises, "never"];
  return next.sets < next.rises ? [sets, withZone(next.sets)] : [rises, withZone(next.rises)];
}

const kindOf = (found) =>
  [found.kind, Number.isFinite(found.magnitude) ? `magnitude ${magnitude(found.magnitude)}` : "", lower?.sizeOf(found)].filter(Boolean).join(", ");

/** Other names, those that are words before those that are numbers. */
function alsoCalled({ also }) {
  const names = also ? also.split(", ") : [], words = names.filter((name) => /[a-z]{3}/.test(name));
  return names.length ? ` · ${[...words, ...names.filter((name) => !words.includes(name))].slice(0, 3).join(", ").replace(/(\d) /g, "$1\u00a0")}` : "";
}

/** Coordinates of date, as everywhere on the page; of typed ones the equinox can be changed. */
function coordinates({ request, found }) {
  const j2000 = Boolean(request.typed && request.j2000);
  const words = j2000 ? `${hours(found.ra2000)}  ${declination(found.dec2000)}` : `${hours(found.ra)}  ${declination(found.dec)}`;
  const equinox = (label, value) =>
    button(label, () => look({ ...request, j2000: value }, found.name), { class: "chip", disabled: other, "aria-pressed": String(j2000 === value) });
  return el("p", { class: "equinox" }, `${words} `, ...(request.typed
    ? [el("span", { role: "group", "aria-label": NAMES.equinox }, equinox(BUTTONS.ofDate, false), equinox(BUTTONS.j2000, true))]
    : [BUTTONS.ofDate]));
}

function card(found) {
  const may = state.act && !other;
  const [event, when] = nextEvent(found);
  return [
    el("header", {},
      el("div", {}, el("h3", {}, found.name || HEADINGS.place), el("p", { class: "kind" }, kindOf(found), alsoCalled(found)), coordinates(chosen)),
      button("×", forget, { class: "quiet close", "aria-label": BUTTONS.close })),
    el("dl", { class: "figures" },
      el("div", {}, el("dt", {}, READINGS.alt), el("dd", {}, angle(found.alt))),
      el("div", {}, el("dt", {}, READINGS.az), el("dd", {}, azimuth(found.az))),
      el("div", {}, el("dt", {}, event), el("dd", {}, when)),
      el("div", {}, el("dt", {}, READINGS.culminates), el("dd", {}, culminates(found)))),
    found.may ? null : el("p", { class: "why" }, found.why),
    el("div", { class: "buttons" },
      button(BUTTONS.go, go, { id: "go", disabled: !may || !found.may }),
      button(BUTTONS.syncHere, sync, { id: "sync", disabled: !may })),
    lower ? lower.details(found, again) : null,
  ].filter(Boolean);
}

/** The lower part of the card, loaded with the first card. */
let lower = null;

/** Draw the card again although the gateway has said nothing new. */
function again() {
  drawn = "";
  draw();
}

function draw() {
  const box = byId("place");
  const key = JSON.stringify([chosen?.found ?? null, state.act, other]);
  if (key !== drawn) redraw(box, key);
  if (chosen) tellWay(byId("go"), asked || onItsWay());
}

/** Update the card in place, because a button that is replaced under a finger is not pressed. Nobody needs a sync after an arrival, so it is not promoted. */
function tellWay(goes, going) {
  const there = !going && isThere();
  say(goes, going ? BUTTONS.going : there ? BUTTONS.again : BUTTONS.go);
  goes.setAttribute("aria-disabled", String(going));
  goes.classList.toggle("primary", !there);
  byId("sync").setAttribute("aria-disabled", String(Boolean(mount()?.moves)));
}

function redraw(box, key) {
  drawn = key;
  // Keep the focus on its button when the values are updated.
  const focused = box.contains(document.activeElement) ? document.activeElement.id : "";
  box.hidden = !chosen;
  document.body.classList.toggle("has-place", Boolean(chosen));
  const waits = Boolean(chosen && other);
  box.classList.toggle("stale", waits);
  box.title = waits ? "Press Find to look up what you typed." : "";
  document.querySelector("#search [type=submit]").classList.toggle("primary", waits);
  box.replaceChildren(...(chosen ? card(chosen.found) : []));
  if (focused) byId(focused)?.focus();
}

async function renew() {
  if (!chosen || document.hidden) return;
  const { request, found } = chosen;
  const answer = await ask(requestNow(request));
  if (!answer.ok || chosen?.request !== request) return;
  chosen.found = called(answer, found.name);
  draw();
}

/** The parts of the mount's state that affect the verdict: after a change the card is requested again at once. */
const verdictOf = (seen) => seen && JSON.stringify([seen.index, seen.state, seen.held, seen.asleep, seen.aligned, seen.limits]);

export function start() {
  let before = null, went = false;
  setInterval(renew, RENEW);
  subscribe(() => {
    draw();
    const settled = isSettled(mount());
    if (went && settled && chosen && isThere()) notice(`It is there: ${chosen.found.name || "the chosen place"}`);
    went = onItsWay() || (went && !settled);
    const now = verdictOf(mount());
    if (now !== before) renew();
    before = now;
  });
}
