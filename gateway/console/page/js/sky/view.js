/**
 * Where things over the horizon lie on the canvas: stereographic, the zenith in the middle, the horizon as the rim.
 *
 * One looks up, so east is left of south. `facing` is the azimuth that lies at the bottom: with 180 north is up. Zoom
 * and pan move the finished chart about under the canvas; circles stay circles throughout.
 */
import { DEGREE } from "./sphere.js";

/** Pixels around the chart for the letters of the compass; how much it can be enlarged. */
export const MARGIN = 26, CLOSEST = 12;
/** What lies lower than this (the sine of its altitude) is not looked at. */
const NADIR = -0.9;

export class View {
  constructor() {
    this.width = this.height = this.radius = 1;
    this.zoom = 1;
    this.left = this.top = 0;
    this.face(180);
  }

  /** The canvas has this size, CSS pixels. */
  resize(width, height) {
    this.width = width;
    this.height = height;
    this.radius = Math.max(20, Math.min(width, height) / 2 - MARGIN);
    this.#keepInSight();
  }

  /** @param {number} azimuth */
  face(azimuth) {
    this.facing = azimuth;
    this.sine = Math.sin(azimuth * DEGREE);
    this.cosine = Math.cos(azimuth * DEGREE);
  }

  get scale() {
    return this.radius * this.zoom;
  }

  get x() {
    return this.width / 2 + this.left;
  }

  get y() {
    return this.height / 2 + this.top;
  }

  /** A vector over the horizon on the canvas; far outside the rim for what lies below. */
  point([north, east, up]) {
    const scale = this.scale / (1 + Math.max(up, NADIR));
    const s = this.sine, c = this.cosine;
    return [this.x + scale * (east * c - north * s), this.y + scale * (north * c + east * s)];
  }

  /** The reverse. @returns {[number, number, number]} */
  vector(x, y) {
    const right = (x - this.x) / this.scale, down = (y - this.y) / this.scale;
    const square = right * right + down * down, part = 2 / (1 + square);
    const s = this.sine, c = this.cosine;
    return [part * (down * c - right * s), part * (right * c + down * s), (1 - square) / (1 + square)];
  }

  /** The radius on the canvas of the circle of one altitude about the zenith. */
  ring(altitude) {
    return this.scale * Math.tan(((90 - altitude) * DEGREE) / 2);
  }

  /** Whether a point is on the canvas, or less than `room` beside it. */
  sees(x, y, room = 0) {
    return x >= -room && y >= -room && x <= this.width + room && y <= this.height + room;
  }

  /** Enlarge or shrink about a point that stays where it is. */
  enlarge(factor, x, y) {
    const zoom = Math.min(CLOSEST, Math.max(1, this.zoom * factor)), real = zoom / this.zoom;
    this.left = x - this.width / 2 - (x - this.x) * real;
    this.top = y - this.height / 2 - (y - this.y) * real;
    this.zoom = zoom;
    this.#keepInSight();
  }

  pan(right, down) {
    this.left += right;
    this.top += down;
    this.#keepInSight();
  }

  reset() {
    this.zoom = 1;
    this.left = this.top = 0;
  }

  /** The chart covers the middle of the canvas, wherever it is dragged; unenlarged it stands still. */
  #keepInSight() {
    const most = this.scale - this.radius, far = Math.hypot(this.left, this.top);
    if (far > most) {
      this.left *= most / far || 0;
      this.top *= most / far || 0;
    }
  }
}
