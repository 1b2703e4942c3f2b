// Keeps the screen on while a mount moves: by the browser's own means on https and on this computer; where it offers
// none, by a silent picture that plays behind the page, which browsers allow after the first tap.

import { state, subscribe } from "../core/store.js";

/** Milliseconds for which the screen stays on after the motion. */
const AFTER = 60000;
let lock = null;
let picture = null;
let timer = 0;
let wanted = false;
/** How the screen is kept on: by "the browser", "a picture", or "nothing". */
let by = "wakeLock" in navigator ? "the browser" : "a picture";

export const words = () => by === "nothing"
  ? "This browser lets the screen go dark while the mount moves: set a longer time in the device."
  : "The screen stays on while the mount moves.";

function play() {
  if (!picture) {
    picture = document.createElement("video");
    Object.assign(picture, { muted: true, loop: true, playsInline: true, className: "awake", src: new URL("../../data/awake.mp4", import.meta.url).href });
    picture.setAttribute("aria-hidden", "true");
    document.body.prepend(picture);
  }
  picture.play().catch((error) => {
    if (error.name === "NotSupportedError") by = "nothing";
  });
}

async function keepOn() {
  if (by === "a picture") return play();
  try {
    lock ??= await navigator.wakeLock.request("screen");
    lock.addEventListener("release", () => (lock = null));
    if (!wanted) letGo();
  } catch {
    // A hidden page, or a battery that is nearly empty: it is tried again when the page is seen.
  }
}

function letGo() {
  lock?.release();
  picture?.pause();
}

function look() {
  const moves = state.mounts.some((one) => one?.moves);
  if (moves) {
    clearTimeout(timer);
    timer = 0;
    if (!wanted) {
      wanted = true;
      keepOn();
    }
  } else if (wanted && !timer) {
    timer = setTimeout(() => {
      wanted = false;
      timer = 0;
      letGo();
    }, AFTER);
  }
}

export function start() {
  subscribe(look);
  document.addEventListener("visibilitychange", () => !document.hidden && wanted && keepOn());
  addEventListener("pointerup", () => wanted && by === "a picture" && picture?.paused && play());
}
