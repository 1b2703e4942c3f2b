// The state of the page: the last state of every mount, and whether the gateway is connected. Parts of the page
// subscribe and are called at most once per animation frame, however many messages have arrived.

import { Scene } from "../sky/scene.js";

/** @type {{hello: any, heardAt: number, mounts: any[], recordings: any[], toldAt: number, chosen: number, connected: boolean, crowded: boolean, quiet: boolean, act: boolean, pin: string}} */
export const state = { hello: null, heardAt: 0, mounts: [], recordings: [], toldAt: 0, chosen: 0, connected: false, crowded: false, quiet: false, act: false, pin: "" };

/** @type {Set<() => void>} */
const listeners = new Set();
let waiting = false;

/** Call a function after every change, and once now. */
export function subscribe(listener) {
  listeners.add(listener);
  listener();
}

export function changed() {
  if (waiting) return;
  waiting = true;
  // A hidden page is not painted; it is drawn when it becomes visible again.
  requestAnimationFrame(() => {
    waiting = false;
    for (const listener of listeners) listener();
  });
}

/** The selected mount; null before the first state. */
export const mount = () => state.mounts[state.chosen] ?? null;

/** Whether the selected mount can do something, as far as it is known. */
export const can = (name) => mount()?.can?.includes(name) ?? true;

/** The present time by the gateway's clock, Unix seconds; by this device's clock before the first message. */
export const gatewayNow = () =>
  state.hello ? state.hello.now + (performance.now() - state.heardAt) / 1000 : Date.now() / 1000;

/** The selected mount's sky at a moment (Unix seconds): its sidereal time goes on from the last message. */
export const skyAt = (unix) => new Scene(mount(), unix - gatewayNow() + (performance.now() - state.toldAt) / 1000, unix);

/** Apply a message of the gateway to the state. */
export function take(message) {
  if (message.hello) {
    state.hello = message.hello;
    state.heardAt = performance.now();
    state.act = message.hello.act;
  }
  if (message.mounts) {
    const before = state.mounts;
    state.toldAt = performance.now();
    // What it can do is as before while its status is being read again.
    state.mounts = message.mounts.map((now, index) => ({ ...now, can: now.can ?? before[index]?.can, equatorial: now.equatorial ?? before[index]?.equatorial }));
    state.recordings = message.recordings;
    if (state.chosen >= state.mounts.length) state.chosen = 0;
  }
  changed();
}

export function choose(index) {
  state.chosen = index;
  changed();
}
