// The altitude limits: what the configuration allows, and how to narrow that from here until the gateway ends.

import { button, el, say } from "../core/dom.js";
import { ask } from "../core/socket.js";
import { mount, state, subscribe } from "../core/store.js";
import { answered, notice } from "../frame/notices.js";
import { question } from "../frame/question.js";

const number = (text) => Number(text.replace(",", ".").replace("−", "-"));

async function narrow() {
  const { limits, own_limits: [low, high] } = mount();
  const given = await question({
    title: "Narrow the limits?", yes: "Narrow",
    words: `For every program, until the gateway ends; the configuration allows ${low}° to ${high}°. To keep other limits, or wider ones, write lowest and highest under [mount] in gateway.toml.`,
    fields: [{ name: "lowest", label: "Lowest altitude, degrees", value: String(limits.lowest) }, { name: "highest", label: "Highest altitude, degrees", value: String(limits.highest) }],
  });
  if (!given) return;
  const [lowest, highest] = [number(given.lowest), number(given.highest)];
  if (!(lowest >= low && highest <= high && lowest < highest)) {
    notice(`From here the limits can only be narrowed. For gateway.toml, under [mount]: lowest = ${given.lowest}, highest = ${given.highest}`, "refused");
    return;
  }
  answered(await ask({ do: "narrow", lowest, highest }));
}

export function limitsButtons() {
  const hint = el("p", { class: "hint" });
  const narrows = button("Narrow the altitudes…", narrow);
  const back = button("As configured", async () => answered(await ask({ do: "narrow" })));
  subscribe(() => {
    const seen = mount(), own = seen?.own_limits;
    back.hidden = !seen?.limits.by_page;
    narrows.disabled = back.disabled = !state.act || !seen;
    say(hint, own && seen.limits.by_page ? `The configuration allows ${own[0]}° to ${own[1]}°.` : "");
  });
  return [hint, el("div", { class: "buttons" }, narrows, back)];
}
