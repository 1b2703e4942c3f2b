// The view "More": colours, permissions of this page, and information about gateway and mount.

import { BUTTONS, CHOICES, HEADINGS } from "./core/labels.js";
import { button, byId, choice, el, group, say } from "./core/dom.js";
import { angle } from "./core/format.js";
import { mount, state, subscribe } from "./core/store.js";
import { order } from "./frame/notices.js";
import * as gamepad from "./control/gamepad.js";
import * as awake from "./frame/awake.js";
import { askForPin } from "./frame/banners.js";
import { limitsButtons } from "./readings/limits.js";
import { changingList } from "./readings/rows.js";
import { light, onLight, setMode, setStep, sunAltitude } from "./frame/night.js";

const chips = (label) => el("div", { class: "chips", role: "radiogroup", "aria-label": label });

function lightGroup() {
  const modes = chips(HEADINGS.light);
  const steps = chips(HEADINGS.brightness);
  const mode = choice(modes, CHOICES.light, setMode);
  const step = choice(steps, CHOICES.brightness, (value) => setStep(Number(value)));
  const words = el("p", { class: "hint" });
  onLight(() => {
    mode.set(light().mode);
    step.set(String(light().step));
  });
  subscribe(() => say(words, sunAltitude() === null
    ? "By the Sun: red while the Sun is below −6°. Its altitude is not known yet."
    : `By the Sun: red while the Sun is below −6°. It is now at ${angle(sunAltitude())}.`));
  return group(HEADINGS.light, modes, words, el("h4", {}, HEADINGS.brightness), steps);
}

function pageGroup() {
  const words = el("p", {});
  const version = el("p", { class: "hint" });
  const pin = button(BUTTONS.pin, askForPin);
  subscribe(() => {
    say(words, state.act ? "This page may move the mount." : "This page only shows the mount. STOP always works.");
    say(version, state.hello ? `mount-gateway ${state.hello.version}` : "");
    pin.hidden = state.act || !state.hello?.pin;
  });
  const screen = el("p", { class: "hint" });
  const pads = button(BUTTONS.gamepad, () => (gamepad.use(), (pads.hidden = true)), { hidden: gamepad.used() || !isSecureContext });
  subscribe(() => say(screen, `${awake.words()} ${gamepad.words()}`));
  return group(HEADINGS.page, words, version, screen, pin, pads);
}

function guideGroup() {
  const box = el("div", { class: "chips", role: "group", "aria-label": HEADINGS.guide });
  const rates = choice(box, CHOICES.guides, (rate) => order({ do: "guide_rate", rate: Number(rate) }));
  const whole = group(HEADINGS.guide, box);
  subscribe(() => {
    const seen = mount();
    whole.hidden = !seen?.can?.includes("SetGuideRate");
    rates.set(String(seen?.guides?.[0]));
    for (const one of box.children) one.disabled = !state.act;
  });
  return whole;
}

export function start() {
  byId("more").replaceChildren(
    lightGroup(),
    changingList(HEADINGS.surfaces, (seen) => seen.surfaces, "nowhere"),
    changingList(HEADINGS.allowed, (seen) => seen.allowed, "everything", { below: limitsButtons() }),
    guideGroup(),
    group(HEADINGS.keys, el("dl", { class: "keys" }, ...CHOICES.keys.flatMap(([key, words]) => [el("dt", {}, el("kbd", {}, key)), el("dd", {}, words)]))),
    pageGroup(),
  );
}
