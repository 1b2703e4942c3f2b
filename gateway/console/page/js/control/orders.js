// Orders other than motion by hand: tracking and its rate, park and home, sync, hold and release.

import { button, byId, choice, el } from "../core/dom.js";
import { answered } from "../frame/notices.js";
import { sync } from "../finding/place.js";
import { ask } from "../core/socket.js";
import { state, mount, subscribe } from "../core/store.js";

const RATES = [["sidereal", "Stars"], ["lunar", "Moon"], ["solar", "Sun"]];
const send = async (request) => answered(await ask(request));

function row(title, ...content) {
  return el("div", { class: "row" }, el("h3", {}, title), ...content);
}

function group(label, choices, chosen) {
  const box = el("div", { class: "chips", role: "radiogroup", "aria-label": label });
  return [box, choice(box, choices, chosen)];
}

export function start() {
  const [onOff, tracks] = group("Tracking", [["on", "On"], ["off", "Off"]], (value) => send({ do: "track", on: value === "on" }));
  const rates = el("div", { class: "chips", role: "group", "aria-label": "Rate of tracking" },
    ...RATES.map(([rate, words]) => button(words, () => send({ do: "track", on: true, rate }))));
  const syncs = button("Sync…", sync);
  const wakes = button("Wake", () => send({ do: "wake" }));
  const holds = button("Hold still", () => send({ do: mount()?.held ? "release" : "hold" }));
  byId("orders").replaceChildren(
    row("Tracking", onOff),
    row("Follow", rates),
    row("Go to", el("div", { class: "chips" }, button("Park", () => send({ do: "park" })), button("Home", () => send({ do: "home" })),
      button("Unpark", () => send({ do: "unpark" })))),
    row("Mount", el("div", { class: "chips" }, wakes, holds, syncs)),
  );
  subscribe(() => {
    const seen = mount();
    tracks.set(seen ? (seen.tracks ? "on" : "off") : null);
    wakes.hidden = !seen?.asleep;
    holds.textContent = seen?.held ? "Release" : "Hold still";
    for (const one of byId("orders").querySelectorAll("button")) one.disabled = !state.act;
  });
}
