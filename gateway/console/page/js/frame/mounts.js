// Selects the mount that is shown if the gateway has several: one button for each, above every view.

import { byId, choice } from "../core/dom.js";
import { choose, state, subscribe } from "../core/store.js";

export function start() {
  const box = byId("mounts");
  let names = "";
  let chosen = null;
  subscribe(() => {
    const now = state.mounts.map((one) => one.name);
    if (JSON.stringify(now) !== names) {
      names = JSON.stringify(now);
      box.hidden = now.length < 2;
      chosen = choice(box, now.map((name, index) => [String(index), name]), (value) => choose(Number(value)));
    }
    chosen?.set(String(state.chosen));
  });
}
