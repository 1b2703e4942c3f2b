// The list of what is up tonight, in the place of the chart, with the observer's favourites and own list.
// The catalogue is loaded when the list is first opened.

import { BUTTONS, CHOICES, HEADINGS, NAMES } from "../core/labels.js";
import { button, byId, el, say } from "../core/dom.js";
import { angle, azimuth, magnitude, sentence, timeOfDay, zone } from "../core/format.js";
import { gatewayNow, mount, skyAt } from "../core/store.js";
import { ask } from "../core/socket.js";
import { angles, precession, reversed, turned, vector } from "../sky/sphere.js";
import { isMarked, keepList, marked, ownList } from "./kept.js";
import { nightNow } from "./night.js";
import { onPlace } from "./place.js";
import { lookingFrom, tonight } from "./tonight.js";
import { typedPlace } from "./typed.js";
import { sizeOf } from "./details.js";

const MOST = 100;
/** An altitude within two hours is told if it is so much higher than the present one, degrees. */
const HIGHER = 3;
const data = (name) => new URL(`../../data/${name}`, import.meta.url);
/** Magnitudes at which planets are bright; the Moon comes first. */
const BODIES = { Moon: -12, Venus: -4, Jupiter: -2.3, Mars: 0.5, Saturn: 0.7, Mercury: 0, Uranus: 5.7, Neptune: 7.8 };
const BELONGS = {
  all: () => true, planets: ({ kinds }) => kinds === "planet", galaxies: ({ kinds }) => kinds === "G",
  nebulae: ({ kinds }) => /[PD]/.test(kinds), clusters: ({ kinds }) => /[OC]/.test(kinds), doubles: ({ kinds }) => /[2*]/.test(kinds),
};
/** What a row of the whole list calls an object; a cluster in a nebula is a cluster. */
const TYPES = [[/^planet$/, "planet"], [/[OC]/, "cluster"], [/G/, "galaxy"], [/[PD]/, "nebula"], [/2/, "double"]];
let shown = "all";
let catalogue = null;
/** How far down the list was left. */
let left = 0;
/** Looks up what was tapped, as if it were typed. */
let look = (_name) => {};

async function load() {
  const [deep, doubles] = await Promise.all(["deepsky.json", "doubles.json"].map(async (name) => (await fetch(data(name))).json()));
  return [
    ...deep.rows.map(([names, kinds, ra, dec, magnitude, size, width]) => ({ names: names.split("|"), kinds, ra, dec, magnitude, size, width })),
    ...doubles.rows.map(([names, , ra, dec, magnitude, second, apart]) =>
      ({ names: names.split("|"), kinds: "2", ra, dec, magnitude, size: apart / 60, words: `${magnitude} and ${second}, ${apart}″` })),
  ];
}

const planets = () => (mount()?.bodies ?? []).filter(({ name }) => name in BODIES)
  .map(({ name, ra2000, dec2000 }) => ({ names: [name], kinds: "planet", ra: ra2000, dec: dec2000, magnitude: BODIES[name], size: null, words: "" }));

const spelled = (name) => name.toLowerCase().replace(/[^\p{L}\p{N}]/gu, "");

/** Lines of the own list that are not in the catalogue, as the gateway knows them, or why it does not. */
const lookedUp = new Map();

/** Look up the first of them that is not looked up yet; the list is drawn again then. */
async function lookUp(lines) {
  const line = lines.find((one) => !lookedUp.has(one));
  if (line === undefined) return;
  lookedUp.set(line, { names: [line], kinds: "" });
  const { ok, words, name, also, ra2000, dec2000, magnitude: bright, size } = await ask({ do: "look_up", name: line });
  if (!ok) lookedUp.set(line, { names: [line], kinds: "", why: sentence(words) });
  else lookedUp.set(line, { names: [line, name, also].filter(Boolean), kinds: "", ra: ra2000, dec: dec2000, magnitude: bright ?? null, size: size ?? null });
  await lookUp(lines);
}

/** A typed place, J2000. */
function placed(line, { ra, dec, j2000 }) {
  const [ra2000, dec2000] = j2000 ? [ra, dec] : angles(turned(reversed(precession(gatewayNow())), vector(ra, dec)));
  return { names: [line], kinds: "", ra: ra2000, dec: dec2000, magnitude: null, size: null };
}

/** Favourites and the lines of the own list, in their order. */
function own(objects) {
  const byName = new Map(objects.flatMap((object) => object.names.map((name) => [spelled(name), object])));
  const lines = [...marked("favourites"), ...ownList().split("\n").map((line) => line.trim()).filter(Boolean)];
  const found = [...new Set(lines)].map((line) => {
    const place = typedPlace(line);
    return byName.get(spelled(line)) ?? (place && "ra" in place ? placed(line, place) : place ? { names: [line], kinds: "", why: place.asks ?? "Write right ascension and declination." } : line);
  });
  const unknown = found.filter((one) => typeof one === "string");
  if (unknown.some((line) => !lookedUp.has(line))) lookUp(unknown).then(draw);
  return found.map((one) => (typeof one === "string" ? lookedUp.get(one) : one));
}

/** Where it stands at the beginning, and its best altitude if that is much higher. */
function row({ object, altitude, unix }, from) {
  const name = object.names[0], others = object.names.filter((other) => spelled(other) !== spelled(name));
  const called = others.find((other) => /[a-z]{3}/.test(other)) ?? others[0] ?? "";
  const bright = Number.isFinite(object.magnitude) && object.kinds !== "planet" ? `mag ${magnitude(object.magnitude)}` : "";
  const [az, high] = object.ra === undefined ? [] : angles(skyAt(from).place(object.ra, object.dec));
  const rises = altitude > high + HIGHER ? `${angle(altitude, 0)} at ${timeOfDay(unix)}` : "";
  const type = shown === "all" ? TYPES.find(([kinds]) => kinds.test(object.kinds))?.[1] ?? "" : "";
  const figures = [type, rises, object.words ?? [bright, sizeOf(object)].filter(Boolean).join(" · ")].filter(Boolean).join(" · ");
  const parts = [
    el("b", {}, `${isMarked("favourites", name) ? "★ " : ""}${name}`),
    el("span", { class: "best" }, az === undefined ? "" : `${angle(high, 0)} ${azimuth(az).split(" ").at(-1)}`),
    el("span", { class: "called" }, [object.why ?? called, isMarked("seen", name) ? "✓ seen" : ""].filter(Boolean).join(" · ")),
    el("span", { class: "figures" }, figures),
  ];
  const line = button("", () => look(name), { class: "row" });
  line.append(...parts);
  return el("li", {}, line);
}

/** The rows to show, and what is said above them. */
function content(objects, night) {
  const now = gatewayNow(), from = lookingFrom(now, night, skyAt), { limits: all, equatorial, german } = mount();
  const limits = { ...all, hour_angle: equatorial && !german ? all.hour_angle : null }; // a German mount changes its side
  const chosen = shown === "own" ? own(objects) : objects.filter(BELONGS[shown]);
  const placed = chosen.filter((object) => object.ra !== undefined);
  const found = tonight(placed, { from, sceneAt: skyAt, night, limits });
  const best = shown === "own" ? chosen.map((object) => found.find((one) => one.object === object) ?? { object }) : found.slice(0, MOST);
  const moon = night.altitude("moon", from, skyAt(from));
  const when = from > now ? `When it is dark, from ${timeOfDay(from)} ${zone(from)}` : "Now and within two hours";
  const up = `${found.length} of ${chosen.length} ${found.length === 1 ? "is" : "are"} up${shown === "own" ? "" : ", the best first"}`;
  const words = `${chosen.length ? `${when}, ${up}` : "Your list is empty: mark favourites on their cards, or paste a list below"}. The Moon is ${moon > 0 ? `up, ${Math.round(100 * night.lit(from))} % lit` : "below the horizon"}.`;
  return { best, words, from: Math.max(from, now) };
}

/** Where the observer pastes or loads a list of their own. */
function ownForm() {
  const text = el("textarea", { id: "own-list", rows: 5, spellcheck: "false", placeholder: NAMES.ownExample });
  text.value = ownList();
  const file = el("input", { type: "file", id: "own-file", accept: ".txt,.csv,text/plain" });
  file.addEventListener("change", async () => file.files[0] && (text.value = (await file.files[0].text()).slice(0, 20000)));
  const keep = () => {
    keepList(text.value);
    draw();
  };
  return el("details", { class: "own" }, el("summary", {}, HEADINGS.own),
    el("label", { for: "own-list" }, NAMES.own), text,
    el("label", { for: "own-file" }, NAMES.file), file, button(BUTTONS.keepList, keep, { class: "primary" }));
}

async function draw() {
  const rows = byId("tonight-rows"), says = byId("tonight-says");
  try {
    catalogue ??= await load();
  } catch {
    catalogue = null;
    return say(says, "The list could not be loaded; tap Tonight again.");
  }
  const night = await nightNow();
  for (const one of byId("tonight-kinds").children) one.setAttribute("aria-pressed", String(one.dataset.kind === shown));
  byId("tonight").querySelector(".own").hidden = shown !== "own";
  if (!night || !skyAt(0).sky) return say(says, "The list needs the site of the mount, which is not known yet. Set it under Readings.");
  const { best, words, from } = content([...planets(), ...catalogue], night);
  say(says, words);
  rows.replaceChildren(...best.map((one) => row(one, from)));
  byId("tonight").scrollTop = left;
}

/** Build the panel, once. */
function build() {
  const kinds = CHOICES.kinds.map(([kind, label]) => button(label, () => {
    shown = kind;
    left = 0;
    draw();
  }, { "data-kind": kind, class: "chip" }));
  const licence = el("a", { href: data("LICENSE-CC-BY-SA-4.0.txt"), target: "_blank" }, "CC-BY-SA 4.0");
  byId("chart").before(el("section", { id: "tonight", "aria-label": HEADINGS.tonight, tabindex: -1, hidden: true },
    el("div", { id: "tonight-kinds", class: "kinds", role: "group", "aria-label": NAMES.kinds }, ...kinds),
    el("p", { id: "tonight-says", class: "hint", role: "status" }, "Loading…"), ownForm(), el("ol", { id: "tonight-rows" }),
    el("p", { class: "hint" }, "Nebulae, clusters and galaxies: a part of OpenNGC by Mattia Verga, ", licence, ".")));
  onPlace((place) => place && open(false)); // its card stands where the list does
}

/** Open the list, where it was left, or close it; `take` looks up what is tapped. */
export function toggle(take) {
  look = take;
  open(byId("tonight")?.hidden ?? true);
}

function open(on) {
  if (!byId("tonight")) build();
  if (!on) left = byId("tonight").scrollTop;
  byId("tonight").hidden = !on;
  document.body.classList.toggle("has-tonight", on);
  byId("tonight-button").setAttribute("aria-pressed", String(on));
  if (on) draw();
}
