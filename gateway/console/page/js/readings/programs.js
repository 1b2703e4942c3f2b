// The connected programs: address, surface, last command, and commands per second.

import { HEADINGS } from "../core/labels.js";
import { el } from "../core/dom.js";
import { mount, subscribe } from "../core/store.js";

function row(program) {
  return el("li", {},
    el("b", {}, program.name),
    el("span", {}, [program.profile, program.surface.split("@")[0], program.read_only ? "only looks" : ""].filter(Boolean).join(" · ")),
    el("span", {}, `${program.rate.toFixed(1)} commands a second${program.last ? ", last " : ""}`, program.last ? el("code", {}, program.last) : null));
}

export function programsGroup() {
  const list = el("ul", { class: "programs" });
  let before = "";
  subscribe(() => {
    const seen = mount();
    const now = JSON.stringify([seen?.programs, seen?.surfaces]);
    if (!seen || now === before) return;
    before = now;
    list.replaceChildren(...(seen.programs.length
      ? seen.programs.map(row)
      : [el("li", {}, "No program is connected. One connects to ", ...seen.surfaces.flatMap((at, index) => [index ? " or " : "", el("code", {}, at.split("@")[1] ?? at)]), ".")]));
  });
  return el("section", { class: "group" }, el("h3", {}, HEADINGS.programs), list);
}
