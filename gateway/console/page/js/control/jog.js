// Motion by hand: it lasts while a direction is held with a finger, the mouse or an arrow key. It ends on release, and
// also if the pointer, the focus, the view or the page is lost; if the network is lost, the gateway ends it. Every press
// has a number, and every beat names the presses that are held, so that a late answer belongs to its own press alone.

import { byId, isTyping, say } from "../core/dom.js";
import { declination, hours, speed } from "../core/format.js";
import { keep, kept } from "../core/kept.js";
import { notice } from "../frame/notices.js";
import { ask, inBeats, on, tell } from "../core/socket.js";
import { mount, state, subscribe } from "../core/store.js";
import { onView } from "../core/views.js";
import { onStep, step, take, turnTube, WAYS } from "./steps.js";
import { onTurn, turnedUp } from "./turned.js";

/** The direction of a key is that of the arrow in the same place of the pad. */
const KEYS = { ArrowUp: "north", ArrowDown: "south", ArrowLeft: "east", ArrowRight: "west" };
const OPPOSITE = { north: "south", south: "north", east: "west", west: "east" };
/** By direction, what holds it down (a pointer's number, "key" or "gamepad"), on which mount, and the number of the press. @type {Map<string, {by: number|string, mount: number, press: number}>} */
const held = new Map();
let presses = 0;
let rate = 5;
let turned = false, tube = false;

const directionOf = (key) => (turned ? OPPOSITE[KEYS[key]] : KEYS[key]);

/** Press and release the arrow in a place of the pad (`up`, `down`, `left`, `right`), as a gamepad does. */
const atPlace = (place) => directionOf(`Arrow${place[0].toUpperCase()}${place.slice(1)}`);
export const pressAt = (place) => press(atPlace(place), "gamepad");
export function releaseAt(place) {
  if (held.get(atPlace(place))?.by === "gamepad") letGo(atPlace(place));
}
export const changeRate = (by) => setRate(rate + by);
/** The rate, 1 to 9. */
export const rateKey = () => rate;
const buttonOf = (direction) => byId("pad").querySelector(`[data-go="${direction}"]`);

function mark(direction, on) {
  buttonOf(direction).classList.toggle("held", on);
}

async function press(direction, by) {
  if (held.has(direction) || !state.act) return;
  if (step()) {
    take(direction);
    return;
  }
  letGo(OPPOSITE[direction]);
  const mine = { by, mount: state.chosen, press: ++presses };
  held.set(direction, mine);
  mark(direction, true);
  const answer = await ask({ do: "jog", direction, rate, mount: mine.mount, press: mine.press });
  if (answer.ok) return;
  if (held.get(direction) === mine) {
    held.delete(direction);
    mark(direction, false);
  }
  notice(answer.words, "refused");
}

function letGo(direction) {
  const one = held.get(direction);
  if (!held.delete(direction)) return;
  mark(direction, false);
  tell({ do: "let_go", direction, mount: one.mount, press: one.press });
}

/** Release all directions. */
export function letAllGo() {
  for (const direction of [...held.keys()]) letGo(direction);
}

function letPointerGo(event) {
  for (const [direction, { by }] of [...held]) if (by === event.pointerId) letGo(direction);
}

function setRate(wanted) {
  rate = Math.min(9, Math.max(1, wanted));
  byId("rate").value = String(rate);
  byId("rate").style.setProperty("--part", `${(rate - 1) / 8}`);
  face();
  keep("rate", String(rate));
  for (const [direction, { mount, press }] of held) tell({ do: "jog", direction, rate, mount, press });
}

/** What the arrows have to do with the chart: those of an alt-azimuth mount are those of its tube. */
function asInChart() {
  if (tube) return turnedUp() === "zenith" ? "The chart turns with the tube." : "It turns the tube. Tube ↓ turns the chart to match.";
  return turnedUp() === "zenith" ? "" : `${turned ? "W" : "E"} is left, as in the chart.`;
}

/** Turn the pad as the chart is turned. What is held ends, because its arrow is elsewhere then. */
function face() {
  tube = turnTube();
  const now = turnedUp() === "south" && !tube;
  if (now !== turned) letAllGo();
  turned = now;
  byId("pad").dataset.names = tube ? "tube" : "sky";
  byId("pad").dataset.up = turned ? "south" : "north";
  for (const one of byId("pad").querySelectorAll("[data-go]")) {
    const way = WAYS[one.dataset.go].names[Number(tube)];
    say(one.querySelector("b"), tube ? way[0].toUpperCase() + way.slice(1) : way[0].toUpperCase());
    one.setAttribute("aria-label", `Move ${way}`);
  }
  say(byId("pad-hint"), `${step() ? `A tap is ${step()}` : "Hold an arrow to move"}. ${asInChart()}`);
  say(byId("rate-shown"), step() || `rate ${rate}${speed(mount()?.speeds?.[rate - 1])}`);
  for (const id of ["rate", "slower", "faster"]) byId(id).disabled = Boolean(step());
}

function listenToPointers(pad) {
  for (const one of pad.querySelectorAll("[data-go]")) {
    one.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      one.setPointerCapture(event.pointerId);
      press(one.dataset.go, event.pointerId);
    });
    // Enter on a button holds the direction while the key is down.
    one.addEventListener("keydown", (event) => event.key === "Enter" && !event.repeat && press(one.dataset.go, "key"));
    one.addEventListener("keyup", (event) => event.key === "Enter" && letGo(one.dataset.go));
    one.addEventListener("blur", () => held.get(one.dataset.go)?.by === "key" && letGo(one.dataset.go));
  }
  // On the window, because the finger may be lifted outside the button.
  for (const ending of ["pointerup", "pointercancel", "lostpointercapture"]) addEventListener(ending, letPointerGo);
  pad.addEventListener("contextmenu", (event) => event.preventDefault());
}

function listenToKeys(pad) {
  pad.addEventListener("keydown", (event) => {
    const direction = directionOf(event.key);
    if (!direction) return;
    event.preventDefault();
    if (!event.repeat) press(direction, "key");
  });
  addEventListener("keyup", (event) => KEYS[event.key] && letGo(directionOf(event.key)));
  pad.addEventListener("focusout", (event) => !pad.contains(event.relatedTarget) && letAllGo());
  addEventListener("keydown", (event) => {
    if (/^[1-9]$/.test(event.key) && !isTyping(event.target) && !event.ctrlKey && !event.altKey && !event.metaKey) setRate(Number(event.key));
  });
}

export function start() {
  const pad = byId("pad");
  listenToPointers(pad);
  listenToKeys(pad);
  addEventListener("blur", letAllGo);
  addEventListener("pagehide", letAllGo);
  document.addEventListener("visibilitychange", () => document.hidden && letAllGo());
  onView(letAllGo);
  inBeats(() => ({ held: [...held].map(([direction, { mount, press }]) => ({ mount, direction, press })) }));
  on("lost", letAllGo);
  byId("rate").addEventListener("input", () => setRate(Number(byId("rate").value)));
  byId("slower").addEventListener("click", () => setRate(rate - 1));
  byId("faster").addEventListener("click", () => setRate(rate + 1));
  let known = "";
  setRate(Number(kept("rate")) || 5);
  onTurn(face);
  onStep(() => {
    letAllGo();
    face();
  });
  subscribe(() => {
    if ([...held.values()].some(({ mount }) => mount !== state.chosen)) letAllGo();
    for (const one of pad.querySelectorAll("[data-go]")) one.disabled = !state.act;
    const now = JSON.stringify([turnTube(), mount()?.speeds]), at = mount()?.position;
    if (now !== known) face();
    known = now;
    say(byId("control-at"), at ? `${hours(at.ra)}  ${declination(at.dec)}` : "");
  });
}
