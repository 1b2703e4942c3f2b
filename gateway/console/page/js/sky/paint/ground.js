/**
 * Draws what does not move: the sky's disk, circles of altitude, the meridian, the rim, the letters of the compass.
 */
import { angles, DEGREE } from "../sphere.js";

/** Degrees between two circles of altitude: `CLOSER` on a chart whose radius has more than `LARGE` pixels. */
const APART = 30, CLOSER = 10, LARGE = 900;
/** A chart of a smaller radius has four letters around it instead of eight, pixels. */
const ROOMY = 120;
const LETTERS = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/** The distance from the rim to the outer edge of the ring with the letters, pixels. */
const RING = 25;

/** Draw the disk of the sky, a little lighter towards the horizon, within a ring of one colour. */
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

/** Begin a path along the horizon. */
export function rim(context, view) {
  context.beginPath();
  context.arc(view.x, view.y, view.scale, 0, 2 * Math.PI);
}

/** Draw the circles of altitude, and lines to the four points of the compass. */
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

/** Label the circles of altitude if there is room. */
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

/** Draw the rim with a tick every ten degrees, and the letters outside. */
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
    const [right, down] = direction(view, index * 45), main = index % 2 === 0;
    if (!main && view.radius < ROOMY) return;
    const write = (reach) => labels.over(view.x + right * reach, view.y + down * reach, letter, {
      size: main ? 15 : 10, weight: main ? 650 : 400, colour: main ? colours.letters : colours.name,
    });
    // Where the page's figures are, the letter stands within the rim.
    (main ? [14, -14, -42] : [14]).some((beyond) => write(view.scale + beyond));
  });
}

/** The direction on the canvas from the zenith towards an azimuth. */
function direction(view, azimuth) {
  const angle = (azimuth - view.facing) * DEGREE;
  return [Math.sin(angle), Math.cos(angle)];
}
