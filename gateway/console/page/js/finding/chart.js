// The sky chart in its pane: it is loaded after everything else and gets every change; a tap on it opens a card.

import { CHOICES } from "../core/labels.js";
import { onTurn, turn } from "../control/turned.js";
import { byId, say } from "../core/dom.js";
import { notice } from "../frame/notices.js";
import { light, onLight } from "../frame/night.js";
import { onPlace, showPicked } from "./place.js";
import { mount, state, subscribe } from "../core/store.js";

/** Where the figures in the corners of the chart and its buttons stand on it. */
function covered() {
  const chart = byId("chart").getBoundingClientRect();
  return [...byId("chart").querySelectorAll("dt, dd, button")].map((one) => one.getBoundingClientRect()).filter(({ width }) => width)
    .map(({ left, top, right, bottom }) => [left - chart.left, top - chart.top, right - chart.left, bottom - chart.top]);
}

export async function start() {
  const { Sky } = await import("../sky/sky.js");
  const sky = new Sky(byId("sky"), { onPick: showPicked, say: (words) => say(byId("sky-says"), words), covered });
  byId("chart-up").addEventListener("click", turn);
  onTurn((up) => {
    sky.setUp(up);
    say(byId("chart-up"), CHOICES.up[up]);
    byId("chart-up").setAttribute("aria-label", `${CHOICES.up[up]}: ${up === "zenith" ? "down in the chart is where the telescope points" : `${up} is up in the chart`}`);
  });
  byId("chart-in").addEventListener("click", () => sky.enlarge(1.5));
  byId("chart-out").addEventListener("click", () => sky.enlarge(1 / 1.5));
  new ResizeObserver(() => sky.resize()).observe(byId("chart"));
  onLight(() => sky.setNight(light().night));
  onPlace((place) => {
    sky.highlight(place);
    say(byId("sky-says"), place ? `${place.name || "A place"} is chosen.` : "");
  });
  subscribe(() => mount() && sky.update(mount(), state.hello));
}

export const startOrSay = () => start().catch((error) => notice(`The chart of the sky could not be drawn (${error.message}). Everything else works.`, "refused"));
