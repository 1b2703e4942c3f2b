// Shows all mounts on a broker, reading them from the server once a second, and stops them at the press of a button.

import { byId, button, el, say } from "./js/core/dom.js";
import { angle, azimuth, declination, hours, span } from "./js/core/format.js";

const EVERY = 1000;
/** Timeout for an answer of the server, milliseconds. */
const PATIENCE = 5000;
const token = document.querySelector('meta[name="token"]').content;
const root = document.documentElement;
const cards = new Map();

const ask = async (path, options = {}) => {
  const headers = { "X-Token": token };
  const answer = await fetch(path, { headers, cache: "no-store", signal: AbortSignal.timeout(PATIENCE), ...options });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
};

function trouble(words) {
  byId("trouble").hidden = !words;
  say(byId("trouble"), words);
}

/** Milliseconds for which "stop sent" is shown: a card shows the result only after a second or two. */
const TOLD = 4000;
let unsent = "", sent = -TOLD;
async function stop(pressed, of) {
  pressed.classList.add("pressed");
  try {
    const answer = await ask("stop", { method: "POST", body: JSON.stringify(of) });
    unsent = answer.sent ? "" : answer.words;
    if (answer.sent) {
      sent = performance.now();
      say(byId("attention"), answer.words);
    }
  } catch {
    unsent = "STOP WAS NOT SENT: this page's server does not answer. Use the mounts' own keys or their power switches.";
  }
  pressed.classList.remove("pressed");
  trouble(unsent);
}

// Act when the button is pressed, not released; a click without a pointer comes from Enter or an assistive tool.
function stops(pressed, of) {
  pressed.addEventListener("pointerdown", (event) => event.button === 0 && stop(pressed, of));
  pressed.addEventListener("click", (event) => event.detail === 0 && stop(pressed, of));
}

function card(mount) {
  const parts = { name: el("span"), at: el("small"), does: el("p", { class: "does" }), where: el("p", { class: "where" }),
    more: el("p", { class: "more" }), said: el("p", { class: "said" }) };
  const { gateway, mount: name } = mount;
  const halt = button("STOP", () => {}, { "aria-label": `Stop ${name} of ${gateway}` });
  stops(halt, { gateway, mount: name });
  const whole = el("li", { class: "mount" }, el("h2", {}, parts.name, parts.at), halt, parts.does, parts.where, parts.more, parts.said);
  return { whole, parts };
}

const lost = (mount) => !mount.available || !mount.online;

function show({ whole, parts }, mount) {
  whole.dataset.is = lost(mount) ? "lost" : mount.held ? "held" : mount.moving ? "moves" : "rests";
  say(parts.name, mount.mount === "mount" ? mount.gateway : mount.mount);
  say(parts.at, mount.mount === "mount" ? "" : mount.gateway);
  say(parts.does, !mount.available ? "gateway is gone" : !mount.online ? "mount does not answer" : mount.does);
  const place = mount.ra === null ? "" : `RA ${hours(mount.ra * 15)}  Dec ${declination(mount.dec)}`;
  const over = mount.alt === null ? "" : `\nAlt ${angle(mount.alt)}  Az ${azimuth(mount.az)}`;
  say(parts.where, place + over);
  const programs = mount.programs ? `${mount.programs} program${mount.programs === 1 ? "" : "s"}` : "";
  say(parts.more, [mount.model, programs, `told ${span(mount.age)} ago`].filter(Boolean).join(" · "));
  say(parts.said, mount.said && mount.said_age < 60 ? mount.said : "");
}

function showAll({ mounts, there: connected, why }) {
  const now = new Set();
  mounts.forEach((mount, place) => {
    const key = `${mount.gateway}/${mount.mount}`;
    now.add(key);
    if (!cards.has(key)) cards.set(key, card(mount));
    const one = cards.get(key);
    show(one, mount);
    if (byId("mounts").children[place] !== one.whole) byId("mounts").insertBefore(one.whole, byId("mounts").children[place] ?? null);
  });
  for (const [key, one] of cards) {
    if (!now.has(key)) {
      one.whole.remove();
      cards.delete(key);
    }
  }
  const away = mounts.filter(lost).length;
  const move = mounts.filter((mount) => mount.moving && !lost(mount)).length;
  say(byId("summary"), mounts.length === 1 ? "1 mount" : `${mounts.length} mounts`);
  const told = performance.now() - sent < TOLD;
  const there = away ? `${away} not there${told ? ", and not stopped: use the keys or the power switch" : ""}` : "all there";
  say(byId("attention"), [...(told ? ["stop sent"] : []), move ? `${move} moving` : "none moves", there].join(", "));
  byId("none").hidden = mounts.length > 0 || !connected;
  trouble(connected ? unsent : `The broker is not there (${why}): what is shown is old, and STOP is not sent.`);
}

async function follow() {
  try {
    showAll(await ask("fleet.json"));
  } catch {
    trouble("This page's server does not answer: what is shown is old, and STOP is not sent.");
  }
  setTimeout(follow, EVERY);
}

function light(night) {
  root.dataset.light = night ? "night" : "day";
  root.toggleAttribute("data-night", night);
  byId("light").setAttribute("aria-pressed", String(night));
  document.querySelector('meta[name="theme-color"]').setAttribute("content", getComputedStyle(document.body).backgroundColor);
}

byId("light").addEventListener("click", () => {
  light(root.dataset.light !== "night");
  try {
    localStorage.setItem("light-shown", root.dataset.light);
  } catch {
    // A browser without storage chooses the light by the hour at each start.
  }
});
light(root.dataset.light === "night");
stops(byId("stop-all"), {});
follow();
