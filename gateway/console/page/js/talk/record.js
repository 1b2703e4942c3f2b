// The button that begins a recording of the conversation, or ends it and downloads the file; and then one that
// downloads its report, a page with where the telescope pointed, how the mount answered, and what was refused.

import { BUTTONS } from "../core/labels.js";
import { button, el, say } from "../core/dom.js";
import { span } from "../core/format.js";
import { order } from "../frame/notices.js";
import { token } from "../core/socket.js";
import { changed, gatewayNow, state, subscribe } from "../core/store.js";

/** The address of the report of the newest recording that ended; empty before. */
let report = "";
const running = () => state.recordings[state.chosen] ?? null;

/** Download a file, by clicking a link in code. */
function fetchFile(address) {
  const link = el("a", { href: `${address}?token=${encodeURIComponent(token)}`, download: address.split("/").at(-1) });
  document.body.append(link);
  link.click();
  link.remove();
}

async function press() {
  const answer = await order({ do: "record", on: !running() });
  if (!answer.ok || !answer.download) return;
  report = answer.report;
  fetchFile(answer.download);
  changed();
}

export function recordButtons() {
  const reports = button(BUTTONS.report, () => fetchFile(report), { id: "report", hidden: true });
  const made = button(BUTTONS.record, press, { id: "record" });
  const draw = () => {
    const now = running();
    say(made, now ? `End recording, ${span(Math.max(0, Math.round(gatewayNow() - now.since)))}` : BUTTONS.record);
    made.setAttribute("aria-pressed", String(Boolean(now)));
    made.disabled = !state.act;
    reports.hidden = !report || Boolean(now);
  };
  subscribe(draw);
  setInterval(() => running() && draw(), 1000);
  return [made, reports];
}
