/**
 * Draws the lines of the constellations, and their names if there is room.
 */
import { turned } from "../sphere.js";

/** The gap between lines and stars, pixels, less on a small chart; lines lower than this (sine) are left out. */
const GAP = 3.5, SMALL = 90, LOWEST = -0.12;

/** @param {{points: Float64Array}} brush points: x, y and height of every star */
export function figures({ context, view, colours, catalogue, points }) {
  const gap = Math.min(GAP, view.scale / SMALL);
  context.strokeStyle = colours.figure;
  context.lineWidth = 1;
  context.beginPath();
  for (const { lines } of catalogue.figures) {
    for (const line of lines) {
      for (let corner = 1; corner < line.length; corner += 1) {
        stretch(context, points, line[corner - 1] * 3, line[corner] * 3, gap);
      }
    }
  }
  context.stroke();
}

function stretch(context, points, from, to, gap) {
  if (points[from + 2] < LOWEST || points[to + 2] < LOWEST) return;
  const x = points[from], y = points[from + 1], right = points[to] - x, down = points[to + 1] - y;
  const length = Math.hypot(right, down);
  if (length < 3 * gap) return;
  const part = gap / length;
  context.moveTo(x + right * part, y + down * part);
  context.lineTo(x + right * (1 - part), y + down * (1 - part));
}

/** Draw the names, on charts that are large enough. */
export function figureNames({ view, colours, catalogue, scene, labels }) {
  if (view.scale < 240) return;
  const size = view.scale < 420 ? 9 : 10.5;
  for (const { name, at } of catalogue.figures) {
    const over = turned(scene.sky, at);
    if (over[2] < 0.08) continue;
    const [x, y] = view.point(over);
    if (view.sees(x, y)) {
      labels.over(x, y, name.toUpperCase(), { size, colour: colours["figure-name"], spacing: size * 0.14 });
    }
  }
}
