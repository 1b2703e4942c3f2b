// Important conditions, each with a button that resolves it: no connection, a page that only looks, a mount on hold,
// hibernating, busy or disconnected, and a clock or site that cannot be right.

import { BUTTONS, HEADINGS, NAMES } from "../core/labels.js";
import { button, byId, el } from "../core/dom.js";
import { sentence, span } from "../core/format.js";
import { order } from "./notices.js";
import { question } from "./question.js";
import { silence } from "../core/socket.js";
import { mount, state, subscribe } from "../core/store.js";
import { tellTime } from "../readings/site.js";

let shown = "";

export async function askForPin() {
  const given = await question({
    title: HEADINGS.pin, words: "Without the pin a page only looks and stops.", yes: HEADINGS.act,
    fields: [{ name: "pin", label: NAMES.pin, type: "password" }],
  });
  if (!given) return;
  const answer = await order({ do: "pin", pin: given.pin });
  state.pin = answer.ok ? given.pin : "";
  state.act = state.act || answer.ok;
}

/** @returns {Array<[string, string, string?, (() => void)?]>}  kind, text, label of the button, its action */
function now() {
  if (!state.connected) return [["bad", lostWords()]];
  const seen = mount();
  if (!seen) return [];
  const rows = [];
  if (seen.state === "down") rows.push(["bad", `The mount does not answer${seen.reason ? `: ${seen.reason}` : ""}. Look at its cable and its power; the gateway goes on trying.`]);
  if (seen.state === "busy") rows.push(["note", `The mount is busy${seen.reason ? `: ${seen.reason}` : ""}.`]);
  if (seen.held) rows.push(["held", "The mount is held: nothing moves it before it is released.", BUTTONS.release, () => order({ do: "release" })]);
  if (seen.asleep) rows.push(["note", "The mount is asleep.", BUTTONS.wake, () => order({ do: "wake" })]);
  if (seen.parked) rows.push(["note parked", seen.goto_unparks ? "The mount is parked. Go there and the arrows move it all the same; it is not parked any more then." : "The mount is parked: unpark it first. Many mounts refuse gotos and arrows before that.", BUTTONS.unpark, () => order({ do: "unpark" })]);
  if (seen.aligned === false) rows.push(["note", "The mount is not aligned, so it does not know where it points. Align it at its hand control."]);
  if (seen.clock_doubt) rows.push(["bad", sentence(seen.clock_doubt), BUTTONS.time, tellTime]);
  if (seen.site_doubt) rows.push(["bad", sentence(seen.site_doubt)]);
  if (!state.act) rows.push(["note", "This page only looks. STOP works all the same.", ...(state.hello?.pin ? [BUTTONS.pin, askForPin] : [])]);
  return rows;
}

function lostWords() {
  if (!state.hello) return "Connecting to the gateway…";
  if (state.crowded) return "Too many pages are open, so the gateway has closed this one, which was not used for longest. What is shown is old, and STOP does not get through. Reload the page to use it; else it is tried again in a minute.";
  return `No connection to the gateway for ${span(Math.round(silence()))}; trying again. What is shown is old: a goto goes on, and STOP does not get through. Stop at the mount itself.`;
}

function draw() {
  const rows = now();
  const key = JSON.stringify(rows.map(([kind, words, press]) => [kind, words, press]));
  if (key === shown) return;
  shown = key;
  byId("banners").replaceChildren(...rows.map(([kind, words, press, does]) =>
    el("div", { class: `banner ${kind}` }, el("p", {}, words),
      press && (state.act || press === BUTTONS.pin) ? button(press, does) : null)));
}

export function start() {
  subscribe(draw);
  setInterval(() => state.connected || draw(), 1000);
}
