// STOP: the button, Escape anywhere, Space anywhere except in text fields. It acts on press, not on release, and stops
// every mount of this gateway. A stop that nobody has answered is owed: it is sent again as soon as the gateway is
// connected, also by a page that was loaded anew, but not after half a minute: then the page says that it was not sent.
// The gateway answers when the mount has come to rest, so a question that is answered at once goes behind the stop: without
// its answer within a second the user is told. Of a stop after which another motion was ordered here nothing is told.

import { STATES } from "../core/labels.js";
import { byId, isTyping, say } from "../core/dom.js";
import { span } from "../core/format.js";
import { answered, notice, outdated } from "./notices.js";
import { ask, hurry, on, urgentIf } from "../core/socket.js";
import { state, subscribe } from "../core/store.js";

const UNHEARD = "STOP DID NOT REACH THE GATEWAY. Use the mount's own keys or its power switch. It is sent again if the gateway is there within 30 s.";
const NOT_SENT = "STOP WAS NOT SENT: the gateway was not there for 30 s. Press it again, or use the mount's own keys or its power switch.";
/** Milliseconds for which an owed stop stays valid, after which a stop counts as not heard, and by which timers may be early. */
const WANTED = 30000, HEARD = 1000, EARLY = 10;
/** Where the tab keeps when an owed stop was pressed, Unix milliseconds. */
const OWED = "stop-owed";
/** The number of unanswered stops since the last motion that was ordered here, and how many of these there were. */
let underWay = 0, motions = 0;
/** When the owed stop was pressed, in a browser without storage; 0 if none is. */
let owed = 0;
/** Whether the last stop was given up. */
let givenUp = false;

/** The label of the button: what it stops, or that it is stopping. */
function tell() {
  byId("stop").classList.toggle("pressed", underWay > 0);
  const stops = state.mounts.length > 1 ? STATES.allMounts : STATES.allMotion;
  const unsent = givenUp ? STATES.notSent : !state.connected && isOwed() ? STATES.owed : "";
  say(byId("stop-says"), underWay ? STATES.stopping : unsent || stops);
}

function owe(since) {
  try {
    if (since === null) sessionStorage.removeItem(OWED);
    else sessionStorage.setItem(OWED, String(since));
  } catch {
    owed = since ?? 0;
  }
}

/** When the stop was pressed that nobody has answered, Unix milliseconds; 0 if there is none. */
function owedSince() {
  try {
    owed = Number(sessionStorage.getItem(OWED));
  } catch {
    // Without storage it is owed until the page is loaded anew.
  }
  return owed;
}

const isOwed = () => Math.abs(Date.now() - owedSince()) < WANTED;

/** Say that the stop did not get through: that it is tried again, or that it was given up. */
function failed() {
  givenUp = !isOwed();
  notice(givenUp ? NOT_SENT : UNHEARD, "refused");
  tell();
}

/** @param {number} [since]  when it was pressed, Unix milliseconds, of one that is sent again */
export async function stop(since = Date.now()) {
  underWay += 1;
  givenUp = false;
  tell();
  outdated();
  owe(since);
  let late = 0;
  const before = motions, unheard = setTimeout(failed, HEARD);
  const stopped = ask({ do: "stop", mount: -1 });
  ask({ do: "search", text: "" }).then(() => {
    clearTimeout(unheard);
    late = Date.now() - since;
  });
  setTimeout(() => !state.connected && owedSince() === since && failed(), since + WANTED + EARLY - Date.now());
  hurry();
  const answer = await stopped;
  clearTimeout(unheard);
  if (!answer.lost) {
    owe(null);
    givenUp = false;
  }
  if (before !== motions) return;
  underWay -= 1;
  tell();
  const words = late > HEARD ? `STOP arrived ${span(Math.round(late / 1000))} late: ${answer.words}` : answer.words;
  if (answer.lost) failed();
  else answered({ ...answer, words });
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
  urgentIf(isOwed);
  on("open", () => {
    if (isOwed()) stop(owedSince());
    else if (owedSince()) {
      failed();
      owe(null);
    }
  });
  on("ordered", () => {
    motions += 1;
    underWay = 0;
    givenUp = false;
    tell();
  });
  subscribe(tell);
}
