/**
 * What stands still: the sky's disk, the rings of altitude, the meridian, the rim and the letters of the compass.
 */
import { angles, DEGREE } from "../sphere.js";

/** Degrees between two rings; on a chart whose radius is more pixels than that they are closer. */
const APART = 30, CLOSER = 10, LARGE = 900;
const LETTERS = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/** Pixels from the rim to the outer edge of the ring that carries the letters. */
const RING = 25;

/** The disk of the sky, a little lighter towards the horizon, in a ring of one colour. */
export function disk({ context, view, colours }) {
  context.fillStyle = colours.ring;
  context.beginPath();
  context.arc(view.x, view.y, view.scale + RING, 0, 2 * Math.PI);
  context.fill();
  const fill = context.createRadialGradient(view.x, view.y, 0, view.x, view.y, view.scale);
  fill.addColorStop(0, colours.zenith);
  fill.addColorStop(0.55, colours.zenith);
  fill.addColorStop(1, colours.horizon);
  context.fillStyle = fill;
  rim(context, view);
  context.fill();
}

/** The horizon as a path. */
export function rim(context, view) {
  context.beginPath();
  context.arc(view.x, view.y, view.scale, 0, 2 * Math.PI);
}

/** Rings of altitude, and the lines to the four points of the compass. */
export function grid({ context, view, colours }) {
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.beginPath();
  for (const altitude of rings(view)) {
    context.moveTo(view.x + view.ring(altitude), view.y);
    context.arc(view.x, view.y, view.ring(altitude), 0, 2 * Math.PI);
  }
  for (let azimuth = 0; azimuth < 360; azimuth += 90) {
    const [right, down] = direction(view, azimuth);
    context.moveTo(view.x + right * view.ring(88), view.y + down * view.ring(88));
    context.lineTo(view.x + right * view.scale, view.y + down * view.scale);
  }
  context.stroke();
}

/** What the rings are, where there is room. */
export function ringNames({ view, colours, labels }) {
  const [centre] = angles(view.vector(view.width / 2, view.height / 2));
  const [right, down] = direction(view, view.scale > LARGE ? centre : view.facing + 45);
  for (const altitude of rings(view)) {
    const reach = view.ring(altitude);
    labels.over(view.x + right * reach, view.y + down * reach, `${altitude}°`, {
      size: 10, colour: colours["figure-name"],
    });
  }
}

function rings(view) {
  const step = view.scale > LARGE ? CLOSER : APART;
  return Array.from({ length: 90 / step - 1 }, (_, index) => (index + 1) * step);
}

/** The rim with a tick every ten degrees, and the letters outside of it. */
export function compass({ context, view, colours, labels }) {
  context.strokeStyle = colours.rim;
  context.lineWidth = 1.5;
  rim(context, view);
  context.stroke();
  context.lineWidth = 1;
  context.beginPath();
  for (let azimuth = 0; azimuth < 360; azimuth += 10) {
    const [right, down] = direction(view, azimuth), end = view.scale + (azimuth % 45 ? 3 : 5);
    context.moveTo(view.x + right * view.scale, view.y + down * view.scale);
    context.lineTo(view.x + right * end, view.y + down * end);
  }
  context.stroke();
  LETTERS.forEach((letter, index) => {
    const [right, down] = direction(view, index * 45), reach = view.scale + 14;
    const main = index % 2 === 0;
    labels.over(view.x + right * reach, view.y + down * reach, letter, {
      size: main ? 15 : 10, weight: main ? 650 : 400, colour: main ? colours.letters : colours.name, must: true,
    });
  });
}

/** The way on the canvas from the zenith towards an azimuth. */
function direction(view, azimuth) {
  const angle = (azimuth - view.facing) * DEGREE;
  return [Math.sin(angle), Math.cos(angle)];
}
