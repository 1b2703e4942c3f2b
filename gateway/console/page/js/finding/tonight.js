// What is up tonight, and in which order: pure functions of places, a sky and a night, without the page.

import { lit } from "../sky/moon.js";
import { angles, DEGREE, dot, precession, reversed, TURN, turned, vector } from "../sky/sphere.js";

/** How far ahead a list looks, and its steps, seconds. */
const AHEAD = 7200, STEP = 600;
/** The Sun's altitude at which it is dark enough to look; how much later that may be. */
const DARK = -6, LATER = 57600;
/** The Sun's lowest altitude for its limit to apply. */
const SUN_IS_UP = -1;
/** The magnitude that an object without one is given; by how much doubles count as fainter. */
const UNMEASURED = 11, DOUBLE = 4;
const SMALLEST = 1, LARGEST = 60;
const isCluster = (kinds) => /[OC]/.test(kinds), isFaint = (kinds) => /[GPD]/.test(kinds) && !isCluster(kinds);

/** The directions of date of Sun and Moon through a night, between what the gateway has told. */
export class Night {
  constructor({ begins, step, sun, moon }) {
    Object.assign(this, { begins, step, ends: begins + step * (sun.length - 1) });
    this.places = { sun, moon };
  }

  /** @param {"sun" | "moon"} body */
  direction(body, unix) {
    const places = this.places[body], part = Math.min(Math.max((unix - this.begins) / this.step, 0), places.length - 1);
    const index = Math.min(Math.floor(part), places.length - 2), share = part - index;
    const [first, second] = [places[index], places[index + 1]].map((place) => vector(...place));
    const between = first.map((value, axis) => value + share * (second[axis] - value));
    return between.map((value) => value / Math.hypot(...between));
  }

  altitude(body, unix, scene) {
    return angles(turned(scene.ofDate, this.direction(body, unix)))[1];
  }

  /** How much of the Moon is lit, from 0 to 1. */
  lit(unix) {
    return lit(this.direction("moon", unix), this.direction("sun", unix));
  }
}

/** The time from which one looks: now, or when it is dark tonight; in steps, so that a list does not change all the time. */
export function lookingFrom(now, night, sceneAt) {
  const first = Math.floor(now / STEP) * STEP;
  for (let unix = first; unix < Math.min(night.ends, first + LATER); unix += STEP) {
    if (night.altitude("sun", unix, sceneAt(unix)) < DARK) return unix;
  }
  return first;
}

/** What an object is worth looking at: the formula of docs/console.md. */
export function worth({ names, kinds, magnitude, size }, altitude, moonlight) {
  const large = Math.log10(Math.min(Math.max(size ?? SMALLEST, SMALLEST), LARGEST));
  const light = isFaint(kinds) ? moonlight : isCluster(kinds) ? moonlight / 3 : 0;
  const faint = (magnitude ?? UNMEASURED) + (kinds === "2" ? DOUBLE : 0) + light;
  const messier = /^M\d/.test(names?.[0] ?? "") ? 1 : 0;
  return 4 * Math.sin(altitude * DEGREE) - faint + messier + (isCluster(kinds) ? 1 : 0.5) * large;
}

/**
 * The objects that stand within the limits now or within two hours, the best first.
 * @param {Array<{names: string[], kinds: string, ra: number, dec: number, magnitude: number|null, size: number|null}>} objects
 * @param {{from: number, sceneAt: (unix: number) => any, night: Night, limits: {lowest: number, highest: number, sun?: number, hour_angle?: number|null}}} sky
 */
export function tonight(objects, { from, sceneAt, night, limits }) {
  const times = Array.from({ length: AHEAD / STEP + 1 }, (_, index) => from + index * STEP);
  const skies = times.map((unix) => {
    const scene = sceneAt(unix), up = Math.max(0, Math.sin(night.altitude("moon", unix, scene) * DEGREE));
    const [north, east, zenith] = [0, 3, 6].map((row) => scene.sky.slice(row, row + 3)), latitude = scene.latitude * DEGREE;
    const meridian = zenith.map((part, axis) => Math.cos(latitude) * part - Math.sin(latitude) * north[axis]);
    const isUp = night.altitude("sun", unix, scene) > SUN_IS_UP;
    const sun = isUp ? turned(reversed(precession(unix)), night.direction("sun", unix)) : null;
    return { unix, zenith, east, meridian, sun, moonlight: 3 * night.lit(unix) * up };
  });
  const nearest = Math.cos((limits.sun ?? 0) * DEGREE), past = (limits.hour_angle ?? 180) * DEGREE;
  const isAllowed = ({ sun, east, meridian }, at) =>
    (!sun || dot(sun, at) < nearest) && Math.abs(Math.atan2(dot(east, at), dot(meridian, at))) <= past;
  const lowest = Math.sin(Math.max(limits.lowest, 1) * DEGREE), highest = Math.sin(limits.highest * DEGREE);
  const found = [];
  for (const object of objects) {
    const at = vector(object.ra, object.dec);
    let best = null, height = 0;
    for (const sky of skies) {
      const high = dot(sky.zenith, at);
      if (high > height && high >= lowest && high <= highest && isAllowed(sky, at)) [best, height] = [sky, high];
    }
    if (!best) continue;
    const altitude = Math.asin(height) / DEGREE;
    found.push({ object, altitude, unix: best.unix, worth: worth(object, altitude, best.moonlight) });
  }
  return found.sort((one, other) => other.worth - one.worth || (one.object.names[0] < other.object.names[0] ? -1 : 1));
}

/** When a J2000 place next stands in the meridian, its altitude there, and when it next crosses `lowest`, null if never. */
export function culmination(ra2000, dec2000, from, sceneAt, lowest = 0) {
  const [ra, dec] = angles(turned(precession(from), vector(ra2000, dec2000))), { sidereal, latitude } = sceneAt(from);
  const sine = (angle) => Math.sin(angle * DEGREE), cosine = (angle) => Math.cos(angle * DEGREE);
  const half = Math.acos((sine(lowest) - sine(latitude) * sine(dec)) / (cosine(latitude) * cosine(dec))) / DEGREE;
  const [unix, rises, sets] = [0, -half, half].map((turn) => from + ((((turn + ra - sidereal) % 360) + 360) % 360) / TURN);
  return { unix, altitude: 90 - Math.abs(latitude - dec), ...(half > 0 && half < 180 ? { rises, sets } : { rises: null, sets: null }) };
}
