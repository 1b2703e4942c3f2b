// The sky's chart in its pane: it is loaded after everything else, told what changes, and what is tapped in it is shown.

import { byId } from "./dom.js";
import { notice } from "./notices.js";
import { light, onLight, palette } from "./night.js";
import { onPlace, showName, showPlace } from "./place.js";
import { mount, state, subscribe } from "./store.js";

export async function start() {
  const { createSky } = await import("./sky/sky.js");
  const canvas = byId("sky");
  const sky = createSky(canvas, { onPick: (picked) => (picked.named ? showName(picked.name) : showPlace(picked, picked.name)), palette });
  new ResizeObserver(() => sky.resize()).observe(byId("chart"));
  onLight(() => sky.setNight(light().night));
  onPlace((place) => sky.highlight(place));
  subscribe(() => mount() && sky.update(mount(), state.hello));
}

export const startOrSay = () => start().catch((error) => notice(`The chart of the sky could not be drawn (${error.message}). Everything else works.`, "refused"));
