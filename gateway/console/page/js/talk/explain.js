// Explains what happens with any command on this mount, in the words of `mount-gateway explain`.

import { byId, choice, say } from "../core/dom.js";
import { ask } from "../core/socket.js";
import { mount, subscribe } from "../core/store.js";

let surface = "";
let known = "";

/** The kinds of the gateway's surfaces: that of `lx200:autostar@tcp://…` is `lx200:autostar`. */
const kinds = (seen) => [...new Set(seen.surfaces.map((name) => name.split("@")[0]))];

function offer() {
  const seen = mount();
  const now = seen ? kinds(seen) : [];
  if (JSON.stringify(now) === known) return;
  known = JSON.stringify(now);
  surface = now[0] ?? "";
  const box = byId("explain-surface");
  box.hidden = now.length < 2;
  const chosen = choice(box, now.map((kind) => [kind, kind]), (value) => chosen.set((surface = value)));
  chosen.set(surface);
}

async function submit(event) {
  event.preventDefault();
  const command = byId("command").value.trim();
  if (!command) return;
  const box = byId("explained");
  box.hidden = false;
  say(box, "It is played through a gateway of its own …");
  const answer = await ask({ do: "explain", surface, command });
  say(box, answer.ok ? answer.text.trimEnd() : answer.words);
  box.scrollIntoView({ block: "nearest" });
}

export function start() {
  byId("explain").addEventListener("submit", submit);
  subscribe(offer);
}
