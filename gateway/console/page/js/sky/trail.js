/**
 * The trail of the tube over the horizon in the last minutes: a new point whenever it has moved a little.
 */
import { separation, vector } from "./sphere.js";

/** How long points are kept, seconds; the distance between two points, degrees; the largest number of points. */
const REMEMBERED = 600, APART = 0.15, MOST = 600;

export class Trail {
  constructor() {
    /** @type {Array<{time: number, at: number[]}>} */
    this.points = [];
  }

  /** Add the present direction of the tube, if it has moved. */
  add(azimuth, altitude, time) {
    const at = vector(azimuth, altitude), last = this.points.at(-1);
    while (this.points.length && (time - this.points[0].time > REMEMBERED || this.points.length >= MOST)) {
      this.points.shift();
    }
    if (!last || separation(last.at, at) >= APART) this.points.push({ time, at });
  }

  clear() {
    this.points = [];
  }

  /** The age of a point, from 0 (new) to 1 (about to be dropped). */
  static age(point, time) {
    return Math.min(1, Math.max(0, (time - point.time) / REMEMBERED));
  }
}
