/**
 * Draws the mount on the sky: the direction of the tube, its trail, the target of a goto, and the path to it.
 * Positions below the horizon are drawn dashed at the rim, with a label.
 */
import { atRim, DEGREE, dot } from "../sphere.js";
import { Trail } from "../trail.js";
import { disk } from "./bodies.js";

/** The opacity of the end of a trail; the number of shades of a trail. */
const OLDEST = 0.12, SHADES = 8;
/** Points so far apart, in seconds and by the cosine of degrees, are not joined: nobody saw the way between them. */
const UNSEEN = 3, APART = Math.cos(5 * DEGREE);
const BELOW = "below the horizon";
/** Patterns of dashed lines. */
const DASHES = [3, 3];
/** The opacity of the reticle of a mount that does not know where it points. */
const UNSURE = 0.45;

export function trail({ context, view, colours, trail: { points }, time }) {
  context.strokeStyle = colours.trail;
  context.lineWidth = 2;
  context.lineJoin = context.lineCap = "round";
  for (let shade = 0; shade < SHADES; shade += 1) {
    context.globalAlpha = OLDEST + (1 - OLDEST) * ((shade + 0.5) / SHADES);
    context.beginPath();
    for (let index = 1; index < points.length; index += 1) {
      const fresh = 1 - Trail.age(points[index], time);
      if (Math.min(SHADES - 1, Math.floor(fresh * SHADES)) !== shade) continue;
      if (points[index].time - points[index - 1].time > UNSEEN && dot(points[index].at, points[index - 1].at) < APART) continue;
      context.moveTo(...view.point(points[index - 1].at));
      context.lineTo(...view.point(points[index].at));
    }
    context.stroke();
  }
  context.globalAlpha = 1;
}

export function way({ context, view, colours, scene }) {
  if (!scene.way.length) return;
  context.strokeStyle = colours.way;
  context.lineWidth = 2;
  context.setLineDash([2, 6]);
  context.lineCap = "round";
  context.beginPath();
  scene.way.forEach((at, index) => {
    const [x, y] = view.point(at);
    if (index) context.lineTo(x, y);
    else context.moveTo(x, y);
  });
  context.stroke();
  context.setLineDash([]);
}

export function target({ context, view, colours, scene, labels }) {
  if (!scene.target) return;
  const [x, y] = view.point(atRim(scene.target)), below = scene.target[2] < 0;
  context.setLineDash(below ? DASHES : []);
  ring(context, x, y, 8, colours.target, colours.shade, 2);
  context.setLineDash([]);
  disk(context, x, y, 2, colours.target);
  labels.keepFree(x, y, 10);
  if (below) labels.beside(x, y, `target ${BELOW}`, { size: 11, weight: 600, colour: colours.target, gap: 14, must: true });
}

/** Draw the picked position: four corners, and its name. */
export function chosen({ context, view, colours, labels, chosen: place }) {
  if (!place) return;
  const [x, y] = view.point(atRim(place.at)), half = 12, arm = 5;
  const draw = () => {
    context.beginPath();
    for (const [right, down] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      context.moveTo(x + right * half, y + down * (half - arm));
      context.lineTo(x + right * half, y + down * half);
      context.lineTo(x + right * (half - arm), y + down * half);
    }
    context.stroke();
  };
  twice(context, colours.chosen, colours.shade, 2, draw);
  labels.keepFree(x, y, half);
  const words = [place.name, place.at[2] < 0 ? BELOW : ""].filter(Boolean).join(", ");
  if (words) {
    labels.beside(x, y, words, { size: 13, weight: 650, colour: colours.chosen, gap: half + 4, must: true });
  }
}

/** Draw the reticle: a ring with a free centre, and four lines that lead to it. */
export function tube({ context, view, colours, scene, labels }) {
  if (!scene.tube) return;
  const [x, y] = view.point(atRim(scene.tube));
  const draw = () => {
    context.beginPath();
    context.arc(x, y, 10, 0, 2 * Math.PI);
    fourLines(context, x, y, 6, 17);
    context.stroke();
  };
  context.setLineDash(scene.tube[2] < 0 ? DASHES : []);
  context.globalAlpha = scene.sure ? 1 : UNSURE;
  twice(context, colours.tube, colours.shade, 2.25, draw);
  context.globalAlpha = 1;
  context.setLineDash([]);
  labels.keepFree(x, y, 14);
}

/** Draw the cross that the keys move. */
export function cursor({ context, view, colours, cursor: at }) {
  if (!at) return;
  const [x, y] = view.point(at);
  twice(context, colours.letters, colours.shade, 1.5, () => {
    context.beginPath();
    fourLines(context, x, y, 4, 13);
    context.stroke();
  });
}

/** Add lines to the path that lead to a point from all sides. */
function fourLines(context, x, y, inner, outer) {
  for (const [right, down] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    context.moveTo(x + right * inner, y + down * inner);
    context.lineTo(x + right * outer, y + down * outer);
  }
}

/** Draw with a dark edge, so that it is visible on any background. */
function twice(context, colour, shade, width, draw) {
  context.lineCap = "butt";
  context.strokeStyle = shade;
  context.lineWidth = width + 2.5;
  draw();
  context.strokeStyle = colour;
  context.lineWidth = width;
  draw();
}

function ring(context, x, y, r, colour, shade, width) {
  twice(context, colour, shade, width, () => {
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
    context.stroke();
  });
}
