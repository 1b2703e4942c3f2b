/**
 * Answers questions about the sky chart's modules: reads lists of [function, arguments…] as JSON from standard input, one
 * a line, and writes the lists of answers. The test that asks knows them from elsewhere.
 */
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";

const folder = pathToFileURL(`${process.argv[2]}/`);
const from = (name) => import(new URL(name, folder));
const sphere = await from("sphere.js"), { View } = await from("view.js"), { Scene } = await from("scene.js");
const { Catalogue } = await from("catalogue.js"), { pick } = await from("pick.js"), { Trail } = await from("trail.js");
const moon = await from("moon.js"), words = await from("words.js"), { project } = await from("paint/stars.js");
const { tube } = await from("paint/mount.js"), { Labels } = await from("paint/labels.js"), { Picture } = await from("paint/picture.js");
const { Stick } = await from("../control/stick.js");
const { typedPlace } = await from("../finding/typed.js");
const { Night, culmination, lookingFrom, tonight, worth } = await from("../finding/tonight.js");

const catalogue = new Catalogue(JSON.parse(readFileSync(new URL("../../data/stars.json", folder), "utf-8")));

function view({ width, height, facing = 180, enlarged = [], panned = [0, 0] }) {
  const found = new View();
  found.resize(width, height);
  found.face(facing);
  for (const [factor, x, y] of enlarged) found.enlarge(factor, x, y);
  found.pan(...panned);
  return found;
}

/** A canvas that keeps where text is written, each letter seven pixels wide. */
function canvas() {
  const texts = {}, gradient = { addColorStop: () => {} };
  const drawn = { texts, createRadialGradient: () => gradient, measureText: (text) => ({ width: 7 * text.length }), fillText: (text, x, y) => (texts[text] = [x, y]) };
  return new Proxy(drawn, { get: (known, name) => known[name] ?? (() => {}), set: () => true });
}

const answers = {
  /** Where text is written on a picture of the Sun, Moon and planets and a chosen place; `covered` areas have other text. */
  texts: (shape, mount, unix, place, covered) => {
    const context = canvas(), scene = new Scene(mount, 0, unix), chosen = { at: scene.place(place.ra2000, place.dec2000), name: place.name };
    const picture = new Picture({ getContext: () => context }, view(shape));
    picture.draw({ scene, catalogue: null, colours: {}, density: 1, trail: new Trail(), time: 0, chosen, cursor: null, covered });
    return context.texts;
  },
  /** On which side a name stands in one picture after another. */
  sides: (shape, steps) => {
    const context = canvas(), labels = new Labels(context, view(shape));
    return steps.map((covered) => {
      labels.begin(covered);
      labels.beside(195, 300, "Vega", { size: 12, colour: "" });
      return context.texts.Vega[0] < 195 ? "left" : "right";
    });
  },
  /** How opaque each line of the mount's reticle is. */
  opacity: (shape, mount) => {
    const lines = [], keep = (known, name, value) => { known[name] = value; return true; };
    const context = new Proxy({}, { set: keep, get: (known, name) => known[name] ?? (() => name === "stroke" && lines.push(known.globalAlpha)) });
    tube({ context, view: view(shape), colours: {}, scene: new Scene(mount, 0, 0), labels: { keepFree: () => {} } });
    return lines;
  },
  /** Altitude and azimuth of a place of J2000. */
  overHorizon: (mount, unix, ra, dec) => sphere.angles(new Scene(mount, 0, unix).place(ra, dec)),
  /** A later moment, without another message. */
  later: (mount, age, unix, ra, dec) => sphere.angles(new Scene(mount, age, unix).place(ra, dec)),
  precessed: (unix, ra, dec) => sphere.angles(sphere.turned(sphere.precession(unix), sphere.vector(ra, dec))),
  point: (shape, azimuth, altitude) => view(shape).point(sphere.vector(azimuth, altitude)),
  atRim: (shape, azimuth, altitude) => view(shape).point(sphere.atRim(sphere.vector(azimuth, altitude))),
  place: (shape, x, y) => sphere.angles(view(shape).vector(x, y)),
  shape: (shape) => (({ zoom, left, top, radius, scale }) => ({ zoom, left, top, radius, scale }))(view(shape)),
  ring: (shape, altitude) => view(shape).ring(altitude),
  circle: (azimuth, altitude, radius) =>
    sphere.circle(sphere.vector(azimuth, altitude), radius)
      .map((at) => sphere.separation(at, sphere.vector(azimuth, altitude))),
  lit: (apart) => moon.lit(sphere.vector(0, 0), sphere.vector(apart, 0)),
  towards: (shape, from_, to) => moon.towards(view(shape), sphere.vector(...from_), sphere.vector(...to)),
  picked: (shape, mount, unix, x, y, reach) => {
    const picture = { view: view(shape), scene: new Scene(mount, 0, unix), catalogue,
      points: new Float64Array(catalogue.count * 3) };
    if (picture.scene.sky) project(picture, picture.points);
    return pick(picture, x, y, reach);
  },
  /** What a gamepad asks for, at each of [milliseconds, right, down, shoulder, other buttons]; the same stick. */
  stick: (speed, steps) => {
    const stick = new Stick(), button = (pressed) => ({ pressed, value: Number(pressed) });
    return steps.map(([now, right, down, shoulder, ...others]) => {
      const buttons = Array.from({ length: 17 }, (_, index) => button((index === 5 && Boolean(shoulder)) || others.includes(index)));
      return stick.take({ axes: [right, down, 0, 0], buttons }, now, speed);
    });
  },
  trail: (steps) => {
    const trail = new Trail();
    return steps.map(([azimuth, altitude, time]) => {
      trail.add(azimuth, altitude, time);
      return trail.points.length;
    });
  },
  /** The list of a night: name, altitude, when, worth; and from when one looks. */
  tonight: (mount, unix, told, objects, limits) => {
    const night = new Night(told), sceneAt = (later) => new Scene(mount, later - unix, later);
    const from = lookingFrom(unix, night, sceneAt), list = tonight(objects, { from, sceneAt, night, limits });
    return { from, lit: night.lit(from), list: list.map((one) => [one.object.names[0], one.altitude, one.unix, one.worth]) };
  },
  altitudeOf: (mount, unix, told, body, later) =>
    new Night(told).altitude(body, later, new Scene(mount, later - unix, later)),
  culmination: (mount, unix, ra, dec) => culmination(ra, dec, unix, (later) => new Scene(mount, later - unix, later)),
  worth: (object, altitude, moonlight) => worth(object, altitude, moonlight),
  typed: (text) => typedPlace(text),
  described: (mount, unix) => words.described(new Scene(mount, 0, unix)),
};

for await (const line of createInterface({ input: process.stdin })) {
  const told = JSON.parse(line).map(([name, ...rest]) => answers[name](...rest) ?? null);
  process.stdout.write(`${JSON.stringify(told)}\n`);
}
