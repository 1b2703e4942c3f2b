// The mount's site and clock, their sources, and how to correct them: with this device's clock, or a typed site.
// Both ask first, and the gateway checks them like those of any other program.

import { button, el } from "../core/dom.js";
import { sentence, span, utc, UNKNOWN } from "../core/format.js";
import { answered, notice } from "../frame/notices.js";
import { question } from "../frame/question.js";
import { ask } from "../core/socket.js";
import { gatewayNow, mount, state, subscribe } from "../core/store.js";
import { rows } from "./rows.js";

/** A larger error of the clock is shown, seconds. */
const EXACT = 1.5;
const offset = () => -new Date().getTimezoneOffset() / 60;
const off = (ahead, of) => (Math.abs(ahead) < EXACT ? `agrees with ${of}` : `${span(ahead)} ${ahead > 0 ? "ahead of" : "behind"} ${of}`);

export async function tellTime() {
  const zone = offset();
  const agreed = await question({
    title: "Use this device's time?", yes: "Set the clock",
    words: `The mount is told ${utc(Date.now() / 1000)}, local time ${zone < 0 ? "−" : "+"}${Math.abs(zone)} h. A wrong time here leads every goto astray.`,
  });
  if (agreed) answered(await ask({ do: "time", unix: Date.now() / 1000, offset: zone }));
}

async function tellSite() {
  const now = mount()?.site;
  const given = await question({
    title: "Where does the mount stand?", yes: "Set the site", words: "In degrees; north and east are positive.",
    fields: [
      { name: "latitude", label: "Latitude", value: now ? now.latitude.toFixed(4) : "" },
      { name: "longitude", label: "Longitude", value: now ? now.longitude.toFixed(4) : "" },
    ],
  });
  if (!given) return;
  const [latitude, longitude] = [given.latitude, given.longitude].map((text) => (text === "" ? NaN : Number(text.replace(",", ".").replace("−", "-"))));
  if (!(Math.abs(latitude) <= 90 && Math.abs(longitude) <= 360)) {
    notice("That is no place on Earth: write latitude and longitude as degrees, like 48.1 and 11.6.", "refused");
    return;
  }
  answered(await ask({ do: "site", latitude, longitude: longitude < -180 ? longitude + 360 : longitude }));
}

const ROWS = [
  ["Site", (seen) => (seen.site ? seen.site.words : "unknown")],
  ["Told by", (seen) => seen.site?.source ?? ""],
  ["Clock", (seen) => (state.hello ? utc(gatewayNow() + (seen.clock?.ahead ?? 0)) : UNKNOWN)],
  ["Clock told by", (seen) => (seen.clock ? `${seen.clock.source}; ${off(seen.clock.ahead, "the gateway's computer")}` : UNKNOWN), "words"],
  ["This device", () => off(Date.now() / 1000 - gatewayNow(), "the gateway's computer"), "words"],
  ["In doubt", (seen) => [seen.clock_doubt, seen.site_doubt].map(sentence).filter(Boolean).join(" "), "words"],
];

export function siteGroup() {
  const figures = rows(ROWS);
  const buttons = [button("Use this device's time…", tellTime), button("Set the site…", tellSite)];
  const draw = () => {
    figures.draw(mount());
    for (const one of buttons) one.disabled = !state.act;
  };
  subscribe(draw);
  setInterval(draw, 1000);
  return el("section", { class: "group" }, el("h3", {}, "Site and clock"), figures.list, el("div", { class: "buttons" }, ...buttons));
}
