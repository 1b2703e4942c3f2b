// What no program polls: the side of the pier, and the rate at which the mount tracks. While the page is seen and the
// mount neither slews nor is moved, the gateway asks the mount for them now and then, when it has come to rest, and when
// it is chosen.

import { ask } from "../core/socket.js";
import { changed, mount, state, subscribe } from "../core/store.js";

const EVERY = 15000, RESTED = 3000;
/** The rates of tracking by name, as multiples of sidereal. */
const RATES = { sidereal: 1, lunar: 0.9763, solar: 0.9973 };
/** By mount, the drive rate. @type {Map<number, number|null>} */
const drives = new Map();

/** The name of the rate at which the mount tracks; null if it does not, or does not tell. */
export function following() {
  const rate = drives.get(state.chosen);
  if (!mount()?.tracks || !rate) return null;
  const [name, off] = Object.entries(RATES).map(([name, value]) => [name, Math.abs(value - rate)]).sort((a, b) => a[1] - b[1])[0];
  return off < 0.005 ? name : null;
}

export async function look() {
  const seen = mount(), chosen = state.chosen;
  if (document.hidden || !state.connected || seen?.state !== "up" || seen.moves || seen.asleep) return;
  const answer = await ask({ do: "look" });
  if (!answer.ok) return;
  drives.set(chosen, JSON.parse(answer.words).drive);
  changed();
}

export function start() {
  setInterval(look, EVERY);
  setTimeout(look, 2000);
  let moved = false, shown = state.chosen;
  subscribe(() => {
    if (state.chosen !== shown) look();
    shown = state.chosen;
    const moves = Boolean(mount()?.moves);
    if (moved && !moves) setTimeout(look, RESTED);
    moved = moves;
  });
}
