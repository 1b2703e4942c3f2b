// The button that begins a recording of the conversation, or ends it and downloads the file; and then one that
// downloads its report, a page with where the telescope pointed, how the mount answered, and what was refused.

import { BUTTONS } from "../core/labels.js";
import { button, el, say } from "../core/dom.js";
import { span } from "../core/format.js";
import { notice, order } from "../frame/notices.js";
import { token } from "../core/socket.js";
import { changed, gatewayNow, state, subscribe } from "../core/store.js";

/** The address of the report of the newest recording that ended; empty before. */
let report = "";
const running = () => state.recordings[state.chosen] ?? null;

const withToken = (address) => `${address}?token=${encodeURIComponent(token)}`;

/** Download a file, by clicking a link in code. */
function download(address, name) {
  const link = el("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
}

/** Download the report, or say why there is none: it is made now, and may fail. */
async function fetchReport() {
  notice("The report is being made.");
  try {
    const answer = await fetch(withToken(report));
    if (!answer.ok) return notice(`There is no report: ${await answer.text()}`, "refused");
    const whole = URL.createObjectURL(await answer.blob());
    download(whole, report.split("/").at(-1));
    URL.revokeObjectURL(whole);
    return notice("");
  } catch {
    return notice("There is no report: the gateway cannot be reached.", "refused");
  }
}

async function press() {
  const answer = await order({ do: "record", on: !running() });
  if (!answer.ok || !answer.download) return;
  report = answer.report;
  download(withToken(answer.download), answer.download.split("/").at(-1));
  changed();
}

export function recordButtons() {
  const reports = button(BUTTONS.report, fetchReport, { id: "report", hidden: true });
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
