// The mount's site and clock, their sources, and how to correct them: with this device's clock, or a typed site.
// The gateway checks both like those of any other program.

import { BUTTONS, HEADINGS, READINGS } from "../core/labels.js";
import { button, byId, el, group, say } from "../core/dom.js";
import { sentence, span, utc, UNKNOWN } from "../core/format.js";
import { answered, notice, order } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { ask } from "../core/socket.js";
import { gatewayNow, mount, state, subscribe } from "../core/store.js";
import { rows } from "./rows.js";

/** A larger error of the clock is shown, seconds. */
const EXACT = 1.5;
const offset = () => -new Date().getTimezoneOffset() / 60;
const off = (ahead, of) => (Math.abs(ahead) < EXACT ? `agrees with ${of}` : `${span(ahead)} ${ahead > 0 ? "ahead of" : "behind"} ${of}`);

/** One tap: the gateway checks the time like that of any program, and says where it differs from other sources. */
export const tellTime = () => order({ do: "time", unix: Date.now() / 1000, offset: offset() });

/** The phone's own place, where the browser gives it; null otherwise. */
const ownPlace = () => new Promise((resolve) => {
  if (!isSecureContext || !navigator.geolocation) return resolve(null);
  return navigator.geolocation.getCurrentPosition(({ coords }) => resolve(coords), () => resolve(null), { timeout: 8000 });
});

/** "48.1, 11.6", also with a comma in the numbers and with N, S, E, W -> degrees, or null. */
export function typedSite(text) {
  const parts = /^\s*([+−-]?\d+(?:[.,]\d+)?)\s*°?\s*([NS]?)\s*(?:[,;]\s*|\s+)([+−-]?\d+(?:[.,]\d+)?)\s*°?\s*([EW]?)\s*$/i.exec(text);
  if (!parts) return null;
  const number = (digits, turned) => Number(digits.replace(",", ".").replace("−", "-")) * (/[SW]/i.test(turned) ? -1 : 1);
  const [latitude, longitude] = [number(parts[1], parts[2]), number(parts[3], parts[4])];
  if (!(Math.abs(latitude) <= 90 && Math.abs(longitude) <= 360)) return null;
  return { latitude, longitude: longitude < -180 ? longitude + 360 : longitude };
}

const written = (place) => (place ? `${place.latitude.toFixed(4)}, ${place.longitude.toFixed(4)}` : "");

async function tellSite() {
  const value = written(mount()?.site), holds = mount()?.site_holds;
  const words = `${holds ? ` It would hold for ${holds}.` : ""} To keep it for good, write it under [mount] in gateway.toml.`;
  const asked = question({
    title: HEADINGS.whereSite, yes: HEADINGS.setSite, words: `Paste or type it, like 48.1, 11.6.${words}`,
    fields: [{ name: "site", label: "Latitude and longitude in degrees, north and east positive", value }],
  });
  const field = byId("ask-site");
  ownPlace().then((own) => {
    if (!own || field.value !== value) return; // something was typed meanwhile
    field.value = written(own);
    say(byId("ask-words"), `This is where this device is.${words}`);
  });
  const given = await asked;
  if (!given) return;
  const place = typedSite(given.site);
  if (!place) return notice("That is no place on Earth: write latitude and longitude as degrees, like 48.1, 11.6.", "refused");
  const answer = await ask({ do: "site", ...place });
  answered(answer.ok ? { ...answer, words: `${answer.words}; for gateway.toml: site = [${place.latitude}, ${place.longitude}]` } : answer);
}

const ROWS = [
  [READINGS.site, (seen) => (seen.site ? seen.site.words : "unknown")],
  [READINGS.siteBy, (seen) => seen.site?.source ?? ""],
  [READINGS.clock, (seen) => (state.hello ? utc(gatewayNow() + (seen.clock?.ahead ?? 0)) : UNKNOWN)],
  [READINGS.clockBy, (seen) => (seen.clock ? `${seen.clock.source}; ${off(seen.clock.ahead, "the gateway's computer")}` : UNKNOWN), "words"],
  [READINGS.device, () => off(Date.now() / 1000 - gatewayNow(), "the gateway's computer"), "words"],
  [READINGS.doubt, (seen) => [seen.clock_doubt, seen.site_doubt].map(sentence).filter(Boolean).join(" "), "words"],
];

export function siteGroup() {
  const figures = rows(ROWS);
  const buttons = [button(BUTTONS.time, tellTime), button(BUTTONS.site, tellSite)];
  const draw = () => {
    figures.draw(mount());
    for (const one of buttons) one.disabled = !state.act;
  };
  subscribe(draw);
  setInterval(draw, 1000);
  return group(HEADINGS.site, figures.list, el("div", { class: "buttons" }, ...buttons));
}
