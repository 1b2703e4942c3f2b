/**
 * Draws the stars as dots, larger for brighter ones, and the names of the brightest.
 *
 * Dots of one size and tint are filled together: a thousand stars need about thirty fills.
 */

const TINTS = ["star-cool", "star", "star-warm"];
/** The faintest magnitude that is drawn, and named, on a small chart without zoom. */
const FAINTEST = 4.5, NAMED = 1.35;
/** Stars brighter than this get a halo. */
const SHINING = 1.7;

/** The limiting magnitude: fainter if there is more room. */
export function faintest(view) {
  return FAINTEST + Math.min(1, Math.max(0, Math.log2(view.scale / 260) * 0.5));
}

/** The radius of a star's dot. */
export function size(view, magnitude) {
  const room = Math.min(2, Math.max(1, Math.sqrt(view.scale / 230)));
  return Math.max(0.55, 0.68 * 1.4 ** (4.4 - magnitude)) * room;
}

/**
 * Write three numbers per star into `points`: its position on the canvas, and the sine of its altitude.
 * @param {Float64Array} points
 */
export function project({ view, scene, catalogue }, points) {
  const m = scene.sky, { vectors, count } = catalogue, { sine, cosine, scale, x, y } = view;
  for (let at = 0; at < count * 3; at += 3) {
    const a = vectors[at], b = vectors[at + 1], c = vectors[at + 2];
    const north = m[0] * a + m[1] * b + m[2] * c, east = m[3] * a + m[4] * b + m[5] * c;
    const up = m[6] * a + m[7] * b + m[8] * c, part = scale / (1 + Math.max(up, -0.9));
    points[at] = x + part * (east * cosine - north * sine);
    points[at + 1] = y + part * (north * cosine + east * sine);
    points[at + 2] = up;
  }
}

export function stars({ context, view, colours, catalogue, points }) {
  const { magnitudes, tints, count } = catalogue, limit = faintest(view);
  let first = 0;
  while (first < count && magnitudes[first] <= limit) {
    const step = Math.floor(magnitudes[first] * 2);
    let last = first;
    while (last < count && magnitudes[last] <= limit && Math.floor(magnitudes[last] * 2) === step) last += 1;
    const radius = size(view, step / 2 + 0.25);
    TINTS.forEach((name, tint) => {
      context.fillStyle = colours[name];
      context.beginPath();
      for (let star = first; star < last; star += 1) {
        const at = star * 3, x = points[at], y = points[at + 1];
        if (tints[star] !== tint || points[at + 2] < 0 || !view.sees(x, y, radius)) continue;
        context.moveTo(x + radius, y);
        context.arc(x, y, radius, 0, 2 * Math.PI);
      }
      context.fill();
    });
    first = last;
  }
}

/** Draw a halo around the brightest stars. */
export function glow({ context, view, colours, catalogue, points }) {
  context.globalAlpha = 0.09;
  for (let star = 0; catalogue.magnitudes[star] < SHINING; star += 1) {
    const at = star * 3, x = points[at], y = points[at + 1], radius = size(view, catalogue.magnitudes[star]);
    if (points[at + 2] < 0 || !view.sees(x, y, 3 * radius)) continue;
    context.fillStyle = colours[TINTS[catalogue.tints[star]]];
    for (const wide of [1.6, 2.1, 2.7]) {
      context.beginPath();
      context.arc(x, y, radius * wide, 0, 2 * Math.PI);
      context.fill();
    }
  }
  context.globalAlpha = 1;
}

export function starNames({ view, colours, catalogue, points, labels, chosen }) {
  const limit = NAMED + Math.max(0, Math.log2(view.scale / 200)) * 1.1;
  const bright = catalogue.named.filter((star) => catalogue.magnitudes[star] <= limit
    && points[star * 3 + 2] > 0.02 && catalogue.names[star] !== chosen?.name && view.sees(points[star * 3], points[star * 3 + 1]));
  for (const star of bright) {
    labels.keepFree(points[star * 3], points[star * 3 + 1], size(view, catalogue.magnitudes[star]));
  }
  for (const star of bright) {
    const at = star * 3;
    labels.beside(points[at], points[at + 1], catalogue.names[star], {
      size: 11, colour: colours.name, gap: size(view, catalogue.magnitudes[star]) + 4,
    });
  }
}
