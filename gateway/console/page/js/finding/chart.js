// The sky chart in its pane: it is loaded after everything else and gets every change; a tap on it opens a card.

import { byId, say } from "../core/dom.js";
import { notice } from "../frame/notices.js";
import { light, onLight } from "../frame/night.js";
import { onPlace, showPicked } from "./place.js";
import { mount, state, subscribe } from "../core/store.js";

export async function start() {
  const { createSky } = await import("../sky/sky.js");
  const canvas = byId("sky");
  const sky = createSky(canvas, { onPick: showPicked, say: (words) => say(byId("sky-says"), words) });
  const ups = [["north", "N ↑"], ["south", "S ↑"], ["zenith", "Tube ↓"]];
  let up = 0;
  byId("chart-up").addEventListener("click", () => {
    const [name, mark] = ups[(up = (up + 1) % ups.length)];
    sky.setUp(name);
    say(byId("chart-up"), mark);
    byId("chart-up").setAttribute("aria-label", name === "zenith" ? "Down in the chart: where the telescope points" : `Up in the chart: ${name}`);
  });
  byId("chart-in").addEventListener("click", () => sky.enlarge(1.5));
  byId("chart-out").addEventListener("click", () => sky.enlarge(1 / 1.5));
  new ResizeObserver(() => sky.resize()).observe(byId("chart"));
  onLight(() => sky.setNight(light().night));
  onPlace((place) => sky.highlight(place));
  subscribe(() => mount() && sky.update(mount(), state.hello));
}

export const startOrSay = () => start().catch((error) => notice(`The chart of the sky could not be drawn (${error.message}). Everything else works.`, "refused"));
