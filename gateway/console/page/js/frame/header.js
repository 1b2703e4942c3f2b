// The first line of the page: what the mount does, and which mount it is.

import { STATES } from "../core/labels.js";
import { byId, say } from "../core/dom.js";
import { sentence } from "../core/format.js";
import { mount, state, subscribe } from "../core/store.js";

/** The activity of a mount, in the words of `mount-gateway status`. */
export function doing(seen) {
  if (seen.state === "opening") return STATES.opening;
  if (seen.state === "down") return STATES.down;
  if (seen.aligned === false && !seen.moves) return STATES.unaligned;
  return sentence(seen.does || STATES.unknown).replace(/\.$/, "");
}

/** The product of the mount; also its name if there are several. */
function called(seen) {
  const own = state.mounts.length > 1 && seen.found ? `${seen.name}: ` : "";
  return own + (seen.found || seen.name);
}

export function start() {
  subscribe(() => {
    const seen = mount();
    const moves = seen && seen.moves;
    // The worst is said first: a mount that is lost on its way does not "move".
    document.body.dataset.mount = !state.connected || !seen ? "lost" : seen.state !== "up" ? seen.state : seen.held ? "held" : moves ? "moves" : "up";
    document.body.classList.toggle("unsure", !state.connected || !seen || (state.quiet && moves) || seen.state === "down" || seen.aligned === false);
    say(byId("does"), !state.connected ? STATES.lost : seen ? doing(seen) : STATES.connecting);
    say(byId("name"), seen ? called(seen) : "mount-gateway");
    say(document.querySelector("title"), seen ? `${state.connected ? doing(seen) : STATES.lost} · ${seen.name}` : "mount-gateway");
  });
}
