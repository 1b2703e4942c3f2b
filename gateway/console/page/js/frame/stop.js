// STOP: the button, Escape anywhere, Space anywhere except in text fields. It acts on press, not on release, and stops
// every mount of this gateway. A stop that nobody has answered is owed: it is sent again as soon as the gateway is
// connected, also by a page that was loaded anew. The gateway answers when the mount has come to rest, so a question
// that is answered at once goes behind the stop: without its answer within a second the user is told. Of a stop after which
// another motion was ordered here nothing is told any more.

import { STATES } from "../core/labels.js";
import { byId, isTyping, say } from "../core/dom.js";
import { answered, notice, outdated } from "./notices.js";
import { ask, on } from "../core/socket.js";
import { state, subscribe } from "../core/store.js";

const UNHEARD = "STOP DID NOT REACH THE GATEWAY. Use the mount's own keys or its power switch. It is sent again as soon as the gateway is there.";
/** Milliseconds for which an owed stop stays valid, and after which a stop counts as not heard. */
const WANTED = 30000, HEARD = 1000;
/** Where the tab keeps when an owed stop was pressed, Unix milliseconds. */
const OWED = "stop-owed";
/** The number of unanswered stops since the last motion that was ordered here, and how many of these there were. */
let underWay = 0, motions = 0;
/** When the owed stop was pressed, in a browser without storage; 0 if none is. */
let owed = 0;

/** The label of the button: what it stops, or that it is stopping. */
function tell() {
  byId("stop").classList.toggle("pressed", underWay > 0);
  say(byId("stop-says"), underWay ? STATES.stopping : !state.connected && isOwed() ? STATES.owed : state.mounts.length > 1 ? STATES.allMounts : STATES.allMotion);
}

function owe(since) {
  try {
    if (since === null) sessionStorage.removeItem(OWED);
    else sessionStorage.setItem(OWED, String(since));
  } catch {
    owed = since ?? 0;
  }
}

function isOwed() {
  try {
    owed = Number(sessionStorage.getItem(OWED));
  } catch {
    // Without storage it is owed until the page is loaded anew.
  }
  return Math.abs(Date.now() - owed) < WANTED;
}

export async function stop() {
  underWay += 1;
  tell();
  outdated();
  owe(Date.now());
  const before = motions, unheard = setTimeout(() => notice(UNHEARD, "refused"), HEARD);
  const stopped = ask({ do: "stop", mount: -1 });
  ask({ do: "search", text: "" }).then(() => clearTimeout(unheard));
  const answer = await stopped;
  clearTimeout(unheard);
  if (!answer.lost) owe(null);
  if (before !== motions) return;
  underWay -= 1;
  tell();
  if (answer.lost) notice(UNHEARD, "refused");
  else answered(answer);
}

function key(event) {
  const space = event.key === " " && !isTyping(event.target);
  if (event.key !== "Escape" && !space) return;
  if (space) event.preventDefault();
  if (!event.repeat) stop();
}

export function start() {
  const pressed = byId("stop");
  pressed.addEventListener("pointerdown", (event) => event.button === 0 && stop());
  // A click without a pointer comes from Enter or from assistive technology.
  pressed.addEventListener("click", (event) => event.detail === 0 && stop());
  pressed.addEventListener("contextmenu", (event) => event.preventDefault());
  addEventListener("keydown", key, { capture: true });
  // Browsers activate a button when Space is released; the stop was sent on press already.
  addEventListener("keyup", (event) => event.key === " " && !isTyping(event.target) && event.preventDefault(), { capture: true });
  on("open", () => isOwed() && stop());
  on("ordered", () => {
    motions += 1;
    underWay = 0;
    tell();
  });
  subscribe(tell);
}
