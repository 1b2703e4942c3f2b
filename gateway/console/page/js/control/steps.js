// What a tap on an arrow of the pad does, instead of moving while it is held: a guide pulse, or a goto to a place that far
// away; and a search in a spiral, one goto a tap. All are bounded, and obey the rules of every other goto.

import { BUTTONS, CHOICES, NAMES } from "../core/labels.js";
import { button, byId, choice, el, say } from "../core/dom.js";
import { can, gatewayNow, mount, skyAt, state, subscribe } from "../core/store.js";
import { askOptics } from "../finding/details.js";
import { field } from "../finding/kept.js";
import { notice, order } from "../frame/notices.js";
import { DEGREE, separation, vector } from "../sky/sphere.js";

/** What the mount must be able to do for a choice; it is a goto for all others. */
const NEEDS = { hold: "Move", pulse: "Pulse" };
/** Milliseconds of a guide pulse. */
const PULSE = 1000;
/** Towards higher declination or altitude, and higher right ascension or lower azimuth; the names on both kinds of mounts. */
export const WAYS = {
  north: { to: [1, 0], names: ["north", "up"] }, south: { to: [-1, 0], names: ["south", "down"] },
  east: { to: [0, 1], names: ["east", "left"] }, west: { to: [0, -1], names: ["west", "right"] },
};
let mode = "hold";
/** Whether the arrows are those of an alt-azimuth mount's tube. A guide pulse goes by the sky on every mount. */
export const turnTube = () => mount()?.equatorial === false && mode !== "pulse";
/** Where a search began, of date, its number of the place, and its step in degrees. */
let spiral = null;
const listeners = [];

/** What a tap does, in words; empty while an arrow moves as long as it is held. */
export const step = () => CHOICES.taps[mode] ?? "";
export const onStep = (listener) => listeners.push(listener);

/** The field of the eyepiece in minutes of arc, which is asked for once; null if it is not told. */
async function asked() {
  if (field() === null) await askOptics();
  return field() === null ? null : field() * 60;
}

/** The place that far from another one on the sky, of date; null beyond a pole. */
function beside({ ra, dec }, up, along) {
  if (Math.abs(dec + up) > 89.5) return null;
  return { ra: (ra + along / Math.cos((dec + up) * DEGREE) + 360) % 360, dec: dec + up, j2000: false };
}

/** The same over the horizon of an alt-azimuth mount, whose arrows are those of its axes. */
function besideOver(at, up, along) {
  const sky = skyAt(gatewayNow());
  if (!sky.ofDate || Math.abs(at.alt + up) > 89) return null;
  const from = sky.ofDateAt(at.az, at.alt), to = sky.ofDateAt(at.az - along / Math.cos(at.alt * DEGREE), at.alt + up);
  return { ra: (at.ra + to[0] - from[0] + 360) % 360, dec: at.dec + to[1] - from[1], j2000: false };
}

function refuse() {
  const seen = mount();
  if (!seen?.position) return "Where it points is not known yet.";
  if (seen.slewing) return "It is still on its way: wait until it is there.";
  return "";
}

async function go(goal, words) {
  if (!goal) return notice("So near to the pole a step leads nowhere: hold an arrow.", "refused");
  return order({ do: "goto", ...goal }, words);
}

/** Make one step in a direction. */
export async function take(direction) {
  if (mode === "pulse") return order({ do: "guide", direction: direction[0], ms: PULSE });
  const why = refuse();
  if (why) return notice(why, "refused");
  const minutes = mode === "field" ? await asked() : Number(mode);
  if (!minutes) return null;
  const { to, names } = WAYS[direction], [up, along] = to.map((part) => (part * minutes) / 60);
  return go((turnTube() ? besideOver : beside)(mount().position, up, along), `${Math.round(minutes)}′ ${names[Number(turnTube())]}`);
}

/** The place of a square spiral with this number, in steps. */
function cell(number) {
  let [x, y, right, up] = [0, 0, 1, 0];
  for (let left = number, side = 1; left > 0; side += 0.5) {
    const steps = Math.min(left, Math.floor(side));
    [x, y, left] = [x + right * steps, y + up * steps, left - steps];
    [right, up] = [-up, right];
  }
  return [x, y];
}

/** The place of the search with this number; null beyond a pole. */
function placeOf(number) {
  const [x, y] = cell(number).map((part) => part * spiral.step);
  return beside(spiral, y, x);
}

/** Whether the telescope is somewhere else than at the last place of the search. */
function elsewhere() {
  const last = placeOf(spiral.number) ?? spiral, { ra, dec } = mount().position;
  return separation(vector(ra, dec), vector(last.ra, last.dec)) > 2 * spiral.step;
}

async function searchOn(number) {
  const why = refuse();
  if (why) return notice(why, "refused");
  if (spiral && elsewhere()) {
    end();
    return notice("The telescope was moved elsewhere, so the search has ended. Spiral search… starts a new one here.", "refused");
  }
  if (!spiral) {
    const wide = await asked();
    if (!wide) return null;
    const { ra, dec } = mount().position;
    spiral = { ra, dec, step: wide / 60, mount: state.chosen, number: 0 };
  }
  const answer = await go(placeOf(number), number ? `Place ${number} of the search` : "Back where the search began");
  if (answer?.ok && spiral) spiral.number = number;
  return draw();
}

/** Begin a search around where the telescope points, or go to its next place. */
export const search = () => searchOn(spiral ? spiral.number + 1 : 1);

function end() {
  spiral = null;
  draw();
}

function draw() {
  if (spiral?.mount !== state.chosen) spiral = null;
  byId("spiral").hidden = !spiral;
  say(byId("spiral-next"), `${BUTTONS.place} ${(spiral?.number ?? 0) + 1}`);
}

export function start() {
  const box = byId("steps");
  const chosen = choice(box, CHOICES.steps, (value) => {
    mode = value;
    chosen.set(value);
    listeners.forEach((listener) => listener());
  });
  chosen.set(mode);
  box.after(
    el("div", { class: "chips", id: "spiral", role: "group", "aria-label": NAMES.spiral, hidden: true },
      button(`${BUTTONS.place} 1`, () => searchOn(spiral.number + 1), { id: "spiral-next" }), button(BUTTONS.back, () => searchOn(0)), button(BUTTONS.end, end)));
  subscribe(() => {
    const choices = [...box.children];
    for (const one of choices) one.hidden = !can(NEEDS[one.dataset.value] ?? "Goto");
    const offered = choices.filter((one) => !one.hidden);
    if (offered.length && !offered.some((one) => one.dataset.value === mode)) offered[0].click();
    for (const part of document.querySelectorAll("#pad, .speed, #pad-hint")) part.hidden = !offered.length;
    for (const one of document.querySelectorAll("#steps button, #spiral button")) one.disabled = !state.act;
    draw();
  });
}
