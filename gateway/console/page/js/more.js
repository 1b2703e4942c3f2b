// The view "More": colours, permissions of this page, and information about gateway and mount.

import { button, byId, choice, el, say } from "./core/dom.js";
import { angle } from "./core/format.js";
import { ask } from "./core/socket.js";
import { mount, state, subscribe } from "./core/store.js";
import { answered } from "./frame/notices.js";
import * as gamepad from "./control/gamepad.js";
import * as awake from "./frame/awake.js";
import { askForPin } from "./frame/banners.js";
import { limitsButtons } from "./readings/limits.js";
import { light, onLight, setMode, setStep, sunAltitude } from "./frame/night.js";

const KEYS = [
  ["Esc", "stops everything, wherever you are"],
  ["Space", "stops everything, except where you type"],
  ["← ↑ → ↓", "move by hand while held, when the pad is chosen (Tab leads there)"],
  ["1 … 9", "the rate of motion by hand"],
  ["Enter", "presses a button"],
];

const group = (title, ...content) => el("section", { class: "group" }, el("h3", {}, title), ...content);
const chips = (label) => el("div", { class: "chips", role: "radiogroup", "aria-label": label });

function lightGroup() {
  const modes = chips("Light");
  const steps = chips("Brightness by night");
  const mode = choice(modes, [["auto", "By the Sun"], ["day", "Day"], ["night", "Red"]], setMode);
  const step = choice(steps, [["-1", "1, dim"], ["0", "2"], ["1", "3"], ["2", "4"], ["3", "5"], ["4", "6, full"]], (value) => setStep(Number(value)));
  const words = el("p", { class: "hint" });
  onLight(() => {
    mode.set(light().mode);
    step.set(String(light().step));
  });
  subscribe(() => say(words, sunAltitude() === null
    ? "By the Sun: red while it stands lower than −6° at the mount. Its altitude is not known yet."
    : `By the Sun: red while it stands lower than −6° at the mount. Now it stands at ${angle(sunAltitude())}.`));
  return group("Light", modes, words, el("h4", {}, "Brightness of the red light"), steps);
}

function pageGroup() {
  const words = el("p", {});
  const version = el("p", { class: "hint" });
  const pin = button("Type the pin", askForPin);
  subscribe(() => {
    say(words, state.act ? "It may move the mount." : "It only looks. STOP works all the same.");
    say(version, state.hello ? `mount-gateway ${state.hello.version}` : "");
    pin.hidden = state.act || !state.hello?.pin;
  });
  const screen = el("p", { class: "hint" });
  subscribe(() => say(screen, `${awake.words()} ${gamepad.words()}`));
  return group("This page", words, version, screen, pin);
}

const GUIDES = [["0.25", "¼"], ["0.5", "½"], ["0.75", "¾"], ["1", "1"]];

function guideGroup() {
  const box = el("div", { class: "chips", role: "group", "aria-label": "Guide rate" });
  const rates = choice(box, GUIDES, async (rate) => answered(await ask({ do: "guide_rate", rate: Number(rate) })));
  const whole = group("Guide rate, a part of sidereal", box);
  subscribe(() => {
    const seen = mount();
    whole.hidden = !seen?.can?.includes("SetGuideRate");
    rates.set(String(seen?.guides?.[0]));
    for (const one of box.children) one.disabled = !state.act;
  });
  return whole;
}

/** A list of sentences that is updated when it changes. */
function list(title, lines, none, ...more) {
  const box = el("ul", { class: "lines" });
  let before = "";
  subscribe(() => {
    const now = mount() ? lines(mount()) : [];
    if (JSON.stringify(now) === before) return;
    before = JSON.stringify(now);
    box.replaceChildren(...(now.length ? now : [none]).map((line) => el("li", {}, line)));
  });
  return group(title, box, ...more);
}

export function start() {
  byId("more").replaceChildren(
    lightGroup(),
    list("Where programs connect", (seen) => seen.surfaces, "nowhere"),
    list("What is allowed", (seen) => seen.allowed, "everything", ...limitsButtons()),
    guideGroup(),
    group("Keys", el("dl", { class: "keys" }, ...KEYS.flatMap(([key, words]) => [el("dt", {}, el("kbd", {}, key)), el("dd", {}, words)]))),
    pageGroup(),
  );
}
