// The limits: what the configuration allows, and how to narrow that from here until the gateway ends.

import { BUTTONS, HEADINGS } from "../core/labels.js";
import { button, el, say } from "../core/dom.js";
import { ask } from "../core/socket.js";
import { mount, state, subscribe } from "../core/store.js";
import { answered, notice, order } from "../frame/notices.js";
import { question } from "../frame/question.js";

/** Name, label, key in gateway.toml, and how many degrees its unit has. */
const LIMITS = [
  ["lowest", "Lowest altitude, degrees", "lowest", 1],
  ["highest", "Highest altitude, degrees", "highest", 1],
  ["sun", "Nearest to the Sun, degrees", "sun", 1],
  ["hour_angle", "Farthest past the meridian, hours; empty: no limit", "hour-angle-limit", 15],
];
const inDegrees = (text, degrees) => (text ? Number(text.replace(",", ".").replace("−", "-")) * degrees : null);

/** The limits that this mount can have: that of the hour angle is for equatorial ones. */
const offered = () => LIMITS.filter(([name]) => name !== "hour_angle" || mount().equatorial !== false);

/** The lines of gateway.toml for values by name; degrees. */
const lines = (values) => offered().filter(([name]) => values[name] !== null)
  .map(([name, , key, degrees]) => `${key} = ${values[name] / degrees}`).join(", ");

async function narrow() {
  const { limits, own_limits } = mount();
  const given = await question({
    title: HEADINGS.narrow, yes: HEADINGS.narrows,
    words: `For every program, until the gateway ends. The configuration allows ${own_limits}.`,
    fields: offered().map(([name, label, , degrees]) => ({ name, label, value: limits[name] === null ? "" : String(limits[name] / degrees) })),
  });
  if (!given) return;
  const asked = Object.fromEntries(offered().map(([name, , , degrees]) => [name, inDegrees(given[name], degrees)]));
  if (Object.values(asked).some(Number.isNaN)) return notice("Write numbers, like 20 or 1.5.", "refused");
  const answer = await ask({ do: "narrow", ...asked });
  answered(answer.ok ? answer : { ...answer, words: `${answer.words} Others are written under [mount] in gateway.toml: ${lines(asked)}` });
}

export function limitsButtons() {
  const hint = el("p", { class: "hint" });
  const narrows = button(BUTTONS.narrow, narrow);
  const back = button(BUTTONS.configured, () => order({ do: "narrow" }));
  subscribe(() => {
    const seen = mount(), narrowed = Boolean(seen?.limits.by_page);
    back.hidden = !narrowed;
    narrows.disabled = back.disabled = !state.act || !seen;
    say(hint, narrowed ? `The configuration allows ${seen.own_limits}. To keep these, write under [mount] in gateway.toml: ${lines(seen.limits)}` : "");
  });
  return [hint, el("div", { class: "buttons" }, narrows, back)];
}
