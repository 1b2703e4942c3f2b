// One exchange on the page: the program's side on the left, the mount's on the right. All content is plain text.

import { el } from "../core/dom.js";
import { toSecond } from "../core/format.js";

/** The label before the bytes: who speaks to whom, in words for screen readers. */
const ARROWS = { ">": ["→", "sent"], "<": ["←", "answered"], "!": ["✕", "refused or failed"], "*": ["●", "asked by a person"], "+": ["+", "connected"], "-": ["−", "gone"], "=": ["↻", "again"], x: ["✕", "dropped"] };

function line(row) {
  const [mark, means] = ARROWS[row.arrow] ?? ["·", ""];
  return el("p", { class: `line ${row.kind}` },
    el("i", { "aria-label": means, role: "img" }, mark),
    el("span", {}, row.data ? el("code", {}, row.data) : null, row.words ? el("span", {}, row.words) : null));
}

/** @param {import("./exchanges.js").Exchange} exchange */
export function element(exchange) {
  const program = [exchange.command, ...exchange.replies].filter(Boolean).map(line);
  return el("article", { class: `exchange${exchange.refused ? " refused" : ""}${exchange.own ? " own" : ""}` },
    el("header", {}, el("time", {}, toSecond(exchange.time)), el("b", {}, exchange.own ? "the gateway" : exchange.side), exchange.surface ? el("span", {}, exchange.surface) : null),
    el("div", { class: "program-side" }, ...program),
    el("div", { class: "mount-side" }, ...exchange.mountRows.map(line)));
}
