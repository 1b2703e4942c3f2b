// Selects the mount that is shown if the gateway has several: one button for each, above every view.

import { byId, changingChoice } from "../core/dom.js";
import { choose, state, subscribe } from "../core/store.js";

export function start() {
  const show = changingChoice(byId("mounts"), (value) => choose(Number(value)));
  subscribe(() => show(state.mounts.map(({ name }, index) => [String(index), name]), String(state.chosen)));
}
