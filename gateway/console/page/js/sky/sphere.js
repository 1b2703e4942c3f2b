/**
 * The sky as unit vectors: rotates catalogue positions into directions over one horizon at one moment.
 *
 * Angles are degrees. The axes of a vector of the sky point to right ascension 0, 6 h and the north pole; those of one
 * over the horizon to north, east and the zenith. A matrix is nine numbers, row by row. Refraction and aberration are
 * left out: they are less than a pixel.
 */

/** @typedef {[number, number, number]} Vector */
/** @typedef {number[]} Matrix */

export const DEGREE = Math.PI / 180;
const ARCSECOND = DEGREE / 3600;
/** J2000.0 in Unix seconds, and the seconds of a Julian century. */
const J2000 = 946728000, CENTURY = 36525 * 86400;
/** The rotation of the sky, degrees a second. */
export const TURN = 360.98564736629 / 86400;

/** The vector of right ascension and declination, or of azimuth and altitude. @returns {Vector} */
export function vector(around, above) {
  const a = around * DEGREE, b = above * DEGREE;
  return [Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b)];
}

/** The angles of a vector, 0 to 360 and -90 to 90 degrees. @returns {[number, number]} */
export function angles([x, y, z]) {
  return [(Math.atan2(y, x) / DEGREE + 360) % 360, Math.atan2(z, Math.hypot(x, y)) / DEGREE];
}

/** @param {Matrix} m @param {Vector} v @returns {Vector} */
export function turned(m, [x, y, z]) {
  return [m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z];
}

/** Two rotations combined: first `b`, then `a`. @param {Matrix} a @param {Matrix} b @returns {Matrix} */
export function product(a, b) {
  const found = [];
  for (let row = 0; row < 9; row += 3) {
    for (let column = 0; column < 3; column += 1) {
      found.push(a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6]);
    }
  }
  return found;
}

/** The inverse rotation. @param {Matrix} m @returns {Matrix} */
export function reversed(m) {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

/** The rotation from J2000 to the equinox of a date (Lieske 1977; without nutation). @param {number} unix @returns {Matrix} */
export function precession(unix) {
  const t = (unix - J2000) / CENTURY;
  const zeta = (2306.2181 * t + 0.30188 * t * t) * ARCSECOND;
  const z = (2306.2181 * t + 1.09468 * t * t) * ARCSECOND;
  const theta = (2004.3109 * t - 0.42665 * t * t) * ARCSECOND;
  return product(product(aboutPole(z), about6h(-theta)), aboutPole(zeta));
}

function aboutPole(angle) {
  const s = Math.sin(angle), c = Math.cos(angle);
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}

function about6h(angle) {
  const s = Math.sin(angle), c = Math.cos(angle);
  return [c, 0, s, 0, 1, 0, -s, 0, c];
}

/** The rotation from the equinox of date to the horizon. @param {number} sidereal @param {number} latitude @returns {Matrix} */
export function horizon(sidereal, latitude) {
  const s = Math.sin(sidereal * DEGREE), c = Math.cos(sidereal * DEGREE);
  const sl = Math.sin(latitude * DEGREE), cl = Math.cos(latitude * DEGREE);
  return [-sl * c, -sl * s, cl, -s, c, 0, cl * c, cl * s, sl];
}

/** Points on a circle around a direction. @param {Vector} v @returns {Vector[]} */
export function circle(v, radius, points = 72) {
  const side = across(v), other = cross(v, side);
  const s = Math.sin(radius * DEGREE), c = Math.cos(radius * DEGREE);
  return Array.from({ length: points }, (_, index) => {
    const a = (index / points) * 2 * Math.PI;
    return v.map((value, axis) => c * value + s * (Math.cos(a) * side[axis] + Math.sin(a) * other[axis]));
  });
}

/** Any direction perpendicular to a vector. */
function across(v) {
  const found = Math.abs(v[2]) < 0.9 ? cross(v, [0, 0, 1]) : cross(v, [1, 0, 0]);
  const length = Math.hypot(...found);
  return found.map((value) => value / length);
}

/** @returns {Vector} */
export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The angle between two directions, degrees. */
export function separation(a, b) {
  return Math.atan2(Math.hypot(...cross(a, b)), dot(a, b)) / DEGREE;
}

/** The height (sine) at which objects below the horizon are shown: just outside the rim. */
const OUTSIDE = 0.02;

/** Move a direction below the horizon to the rim at its azimuth; return any other unchanged. @param {Vector} v @returns {Vector} */
export function atRim([north, east, up]) {
  const far = Math.hypot(north, east) || 1;
  return up >= -OUTSIDE ? [north, east, up] : [north / far, east / far, -OUTSIDE];
}
