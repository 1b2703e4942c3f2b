/**
 * Hatches the areas where the mount may not go: too low, too high, too near the Sun, too far past the meridian.
 */
import { angles, circle } from "../sphere.js";
import { rim } from "./ground.js";

/** The distance of the hatching lines, pixels; the lowest altitude of the Sun for its limit to apply, degrees. */
const PITCH = 8, SUN_IS_UP = -1;

/** The hatching pattern; made again when colour or screen resolution changes. */
export class Hatching {
  #made = "";
  #pattern = null;

  of(context, colour, density) {
    if (this.#made !== `${colour} ${density}`) {
      this.#made = `${colour} ${density}`;
      this.#pattern = draw(context, colour, density);
    }
    return this.#pattern;
  }
}

function draw(context, colour, density) {
  const side = Math.round(PITCH * density), tile = context.canvas.ownerDocument.createElement("canvas");
  tile.width = tile.height = side;
  const brush = tile.getContext("2d");
  brush.strokeStyle = colour;
  brush.lineWidth = density;
  brush.beginPath();
  for (const shift of [-side, 0, side]) {
    brush.moveTo(shift - 1, side + 1);
    brush.lineTo(shift + side + 1, -1);
  }
  brush.stroke();
  const pattern = context.createPattern(tile, "repeat");
  pattern.setTransform(new DOMMatrix().scale(1 / density));
  return pattern;
}

export function forbidden({ context, view, scene, colours, hatching, density }) {
  const limits = scene.mount?.limits;
  if (!limits) return;
  const outlines = [low(view, limits), high(view, limits), nearSun(view, scene, limits), past(view, scene, limits)];
  for (const outline of outlines.filter(Boolean)) {
    context.fillStyle = hatching.of(context, colours.forbidden, density);
    context.beginPath();
    if (outline.outside) context.arc(view.x, view.y, view.scale, 0, 2 * Math.PI);
    trace(context, view, outline);
    context.fill("evenodd");
    context.strokeStyle = colours["forbidden-edge"];
    context.lineWidth = 1;
    context.beginPath();
    trace(context, view, outline);
    context.stroke();
  }
}

function trace(context, view, { ring, path }) {
  if (ring) {
    context.moveTo(view.x + ring, view.y);
    context.arc(view.x, view.y, ring, 0, 2 * Math.PI);
    return;
  }
  path.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
}

function low(view, { lowest }) {
  return lowest > 0 ? { ring: view.ring(lowest), outside: true } : null;
}

function high(view, { highest }) {
  return highest < 90 ? { ring: view.ring(highest) } : null;
}

function nearSun(view, scene, { sun: reach }) {
  const sun = scene.bodies.find(({ name }) => name === "Sun");
  if (!reach || !sun || angles(sun.at)[1] < SUN_IS_UP) return null;
  return { path: circle(sun.at, reach).map((at) => view.point(at)) };
}

/** The area outside two hour circles, for a mount that cannot change its pier side. */
function past(view, scene, { hour_angle: limit }) {
  const { mount } = scene;
  if (limit == null || limit >= 180 || !mount.equatorial || mount.german || !scene.ofDate) return null;
  const path = [];
  for (let dec = -90; dec <= 90; dec += 5) path.push(view.point(scene.atHourAngle(limit, dec)));
  for (let dec = 90; dec >= -90; dec -= 5) path.push(view.point(scene.atHourAngle(-limit, dec)));
  return { path, outside: true };
}

/** Clip drawing to the sky until the context is restored. */
export function withinSky(context, view) {
  context.save();
  rim(context, view);
  context.clip();
}
