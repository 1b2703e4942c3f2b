// STOP: the button, Escape anywhere, Space anywhere except in text fields. It acts on press, not on release, and stops
// every mount of this gateway. A stop that could not be sent is sent as soon as the gateway is connected again.

import { byId, isTyping, say } from "../core/dom.js";
import { answered, notice, outdated } from "./notices.js";
import { ask, on } from "../core/socket.js";
import { state, subscribe } from "../core/store.js";

const UNHEARD = "STOP DID NOT REACH THE GATEWAY. Use the mount's own keys or its power switch. It is sent again as soon as the gateway is there.";
/** Seconds for which a stop that was not sent stays valid. */
const WANTED = 30;
let owed = 0;
/** The number of unanswered stops: the gateway answers when the mount has come to rest. */
let underWay = 0;

/** The label of the button: what it stops, or that it is stopping. */
function tell() {
  byId("stop").classList.toggle("pressed", underWay > 0);
  say(byId("stop-says"), underWay ? "stopping…" : state.mounts.length > 1 ? "all mounts" : "all motion");
}

export async function stop() {
  underWay += 1;
  tell();
  outdated();
  const answer = await ask({ do: "stop", mount: -1 });
  underWay -= 1;
  tell();
  owed = answer.lost ? performance.now() : 0;
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
  on("open", () => owed && performance.now() - owed < WANTED * 1000 && stop());
  subscribe(tell);
}
