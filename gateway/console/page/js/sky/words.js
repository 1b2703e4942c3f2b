/**
 * The chart in words, for screen readers.
 */
import { angles } from "./sphere.js";

const WINDS = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];

export function wind(azimuth) {
  return WINDS[Math.round(azimuth / 45) % 8];
}

/** "altitude 41°, azimuth 283° (west)" */
export function overHorizon(at) {
  const [azimuth, altitude] = angles(at);
  return `altitude ${Math.round(altitude)}°, azimuth ${Math.round(azimuth) % 360}° (${wind(azimuth)})`;
}

/** @param {import("./scene.js").Scene} scene @returns {string} */
export function described(scene) {
  const said = ["Chart of the sky over the telescope."];
  said.push(scene.tube ? `It points to ${overHorizon(scene.tube)}.` : "Where it points is not known yet.");
  if (scene.target) said.push(`It goes to ${overHorizon(scene.target)}.`);
  const up = scene.bodies.filter(({ at }) => at[2] > 0).map(({ name }) => name);
  if (scene.sky) said.push(up.length ? `Above the horizon: ${up.join(", ")}.` : "Neither Sun, Moon nor planet is up.");
  else said.push("Without a site and a time there are no stars on it.");
  said.push("Arrow keys move a cross, Enter picks what is under it, plus and minus enlarge.");
  return said.join(" ");
}

/** A description of what is under the cross. @param {import("./pick.js").Place|null} place */
export function under(place) {
  return place ? `${place.name || "a place"}, ${overHorizon(place.at)}` : "below the horizon";
}
