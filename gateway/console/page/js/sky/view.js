/**
 * The projection from the horizon to the canvas: stereographic, the zenith in the middle, the horizon as the rim.
 *
 * The user looks up, so east is left of south. `facing` is the azimuth at the bottom: with 180 north is up. Zoom
 * and pan apply to the projected chart; circles always stay circles.
 */
import { DEGREE } from "./sphere.js";

/** The margin around the chart for the letters of the compass, pixels; the largest zoom. */
export const MARGIN = 26, CLOSEST = 12;
/** Directions lower than this (sine of the altitude) are not projected. */
const NADIR = -0.9;

export class View {
  constructor() {
    this.width = this.height = this.radius = 1;
    this.zoom = 1;
    this.left = this.top = 0;
    this.face(180);
  }

  /** Set the size of the canvas, CSS pixels. */
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

  /** The point on the canvas of a vector over the horizon; far outside the rim if it is below. */
  point([north, east, up]) {
    const scale = this.scale / (1 + Math.max(up, NADIR));
    const s = this.sine, c = this.cosine;
    return [this.x + scale * (east * c - north * s), this.y + scale * (north * c + east * s)];
  }

  /** The vector over the horizon of a point on the canvas. @returns {[number, number, number]} */
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

  /** Whether a point is on the canvas, or less than `room` pixels outside. */
  sees(x, y, room = 0) {
    return x >= -room && y >= -room && x <= this.width + room && y <= this.height + room;
  }

  /** Zoom around a point that stays in place. */
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

  /** Limit the pan: the chart always covers the middle of the canvas, and without zoom it does not move. */
  #keepInSight() {
    const most = this.scale - this.radius, far = Math.hypot(this.left, this.top);
    if (far > most) {
      this.left *= most / far || 0;
      this.top *= most / far || 0;
    }
  }
}
