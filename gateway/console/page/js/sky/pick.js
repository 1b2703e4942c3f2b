/**
 * Finds what a tap on the chart means: the object nearest to the finger, or the position itself.
 *
 * Of two objects at about the same distance the brighter one wins. The result is enough to ask the server about it.
 */
import { angles, reversed, turned } from "./sphere.js";
import { shown } from "./paint/bodies.js";
import { faintest } from "./paint/stars.js";

/** @typedef {{ra2000: number, dec2000: number, name: string, alt: number, az: number, at: number[]}} Place */

/** How many pixels of distance one magnitude counts. */
const BRIGHT = 2.2;

/**
 * @param {{view: import("./view.js").View, scene: import("./scene.js").Scene,
 *   catalogue: import("./catalogue.js").Catalogue|null, points: Float64Array}} picture
 * @param {number} reach the largest distance to an object, pixels
 * @returns {Place|null} null below the horizon, and while the sky is unknown
 */
export function pick({ view, scene, catalogue, points }, x, y, reach) {
  const at = view.vector(x, y);
  if (!scene.sky || at[2] < 0) return null;
  const found = body(view, scene, x, y, reach) ?? star(view, scene, catalogue, points, x, y, reach);
  return found ?? free(scene, at);
}

function body(view, scene, x, y, reach) {
  const near = shown({ scene, view })
    .map((one) => ({ one, far: Math.hypot(...view.point(one.at).map((value, axis) => value - [x, y][axis])) }))
    .filter(({ far }) => far < reach)
    .sort((a, b) => a.far - b.far);
  return near.length ? told(near[0].one.ra2000, near[0].one.dec2000, near[0].one.name, near[0].one.at) : null;
}

function star(view, scene, catalogue, points, x, y, reach) {
  if (!catalogue) return null;
  const limit = faintest(view);
  let best = -1, least = Infinity;
  for (let index = 0; index < catalogue.count && catalogue.magnitudes[index] <= limit; index += 1) {
    const far = Math.hypot(points[index * 3] - x, points[index * 3 + 1] - y);
    if (far > reach || points[index * 3 + 2] < 0) continue;
    const cost = far + catalogue.magnitudes[index] * BRIGHT;
    if (cost < least) [best, least] = [index, cost];
  }
  if (best < 0) return null;
  const [ra, dec] = catalogue.places[best];
  return told(ra, dec, catalogue.names[best], scene.place(ra, dec));
}

function free(scene, at) {
  const [ra, dec] = angles(turned(reversed(scene.sky), at));
  return told(ra, dec, "", at);
}

function told(ra2000, dec2000, name, at) {
  const [az, alt] = angles(at);
  return { ra2000, dec2000, name, alt, az, at };
}
