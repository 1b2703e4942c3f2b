// Orders other than motion by hand: tracking and its rate, park and home, search, sync, hold and release. What the
// mount cannot do is not offered. What leads the telescope far away asks first.

import { BUTTONS, CHOICES, HEADINGS, NAMES } from "../core/labels.js";
import { button, byId, choice, el, say } from "../core/dom.js";
import { angle, azimuth } from "../core/format.js";
import { can, state, mount, subscribe } from "../core/store.js";
import { sync } from "../finding/place.js";
import { order } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { following, look } from "./look.js";
import { search } from "./steps.js";

function row(title, ...content) {
  return el("div", { class: "row" }, el("h3", {}, title), ...content);
}

function group(label, choices, chosen) {
  const box = el("div", { class: "chips", role: "group", "aria-label": label });
  return [box, choice(box, choices, chosen)];
}

async function goFar(request, title, words) {
  if (await question({ title: `${title}?`, words, yes: title })) order(request);
}

function parkWords() {
  const there = mount()?.park;
  return `It slews to its park position${there ? `, altitude ${angle(there.alt)}, azimuth ${azimuth(there.az)}` : ""}. Tracking ends there.`;
}

export function start() {
  const [onOff, tracks] = group(HEADINGS.tracking, CHOICES.tracking, (value) => order({ do: "track", on: value === "on" }));
  const [rates, follows] = group(NAMES.rates, CHOICES.rates, (rate) => order({ do: "track", on: true, rate }).then(look));
  const syncs = button(BUTTONS.sync, sync);
  const wakes = button(BUTTONS.wake, () => order({ do: "wake" }));
  const holds = button(BUTTONS.hold, () => order({ do: mount()?.held ? "release" : "hold" }));
  const parks = button(BUTTONS.park, () => goFar({ do: "park" }, HEADINGS.park, parkWords()));
  const homes = button(BUTTONS.home, () => goFar({ do: "home" }, HEADINGS.home, "It slews to its home position."));
  const unparks = button(BUTTONS.unpark, () => order({ do: "unpark" }).then(look));
  const searches = button(BUTTONS.search, search);
  const [tracking, followed] = [row(HEADINGS.tracking, onOff), row(HEADINGS.follow, rates)];
  const parking = row(HEADINGS.park, el("div", { class: "chips" }, parks, homes, unparks));
  byId("orders").replaceChildren(
    tracking,
    followed,
    parking,
    row(HEADINGS.mount, el("div", { class: "chips" }, wakes, holds, searches, syncs)),
  );
  subscribe(() => {
    const seen = mount();
    tracks.set(seen ? (seen.tracks ? "on" : "off") : null);
    follows.set(following());
    wakes.hidden = !seen?.asleep;
    tracking.hidden = !can("SetTracking");
    // An alt-azimuth mount tracks at the sidereal rate only: its two motors have no other.
    followed.hidden = !can("TrackRate") || seen?.equatorial === false;
    for (const [one, name] of [[parks, "Park"], [homes, "Home"], [unparks, "Park"], [searches, "Goto"], [syncs, "Sync"]]) one.hidden = !can(name);
    parking.hidden = parks.hidden && homes.hidden;
    say(holds, seen?.held ? BUTTONS.release : BUTTONS.hold);
    for (const one of byId("orders").querySelectorAll("button")) one.disabled = !state.act;
  });
}
