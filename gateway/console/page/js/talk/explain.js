// Explains what happens with any command on this mount, in the words of `mount-gateway explain`.

import { byId, changingChoice, say } from "../core/dom.js";
import { ask } from "../core/socket.js";
import { mount, subscribe } from "../core/store.js";

let surface = "";

/** The kinds of the gateway's surfaces: that of `lx200:autostar@tcp://…` is `lx200:autostar`. */
const kinds = (seen) => [...new Set(seen.surfaces.map((name) => name.split("@")[0]))];

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
  const show = changingChoice(byId("explain-surface"), (value) => {
    surface = value;
    draw();
  });
  const draw = () => {
    const now = mount() ? kinds(mount()) : [];
    if (!now.includes(surface)) surface = now[0] ?? "";
    show(now.map((kind) => [kind, kind]), surface);
  };
  subscribe(draw);
}
