/**
 * Where the tube has pointed in the last minutes, over the horizon: a point whenever it has moved on a little.
 */
import { separation, vector } from "./sphere.js";

/** Seconds that are remembered; degrees between two points; points at most. */
const REMEMBERED = 600, APART = 0.15, MOST = 600;

export class Trail {
  constructor() {
    /** @type {Array<{time: number, at: number[]}>} */
    this.points = [];
  }

  /** The tube points there now. Says whether the trail has grown. */
  add(azimuth, altitude, time) {
    const at = vector(azimuth, altitude), last = this.points.at(-1);
    while (this.points.length && (time - this.points[0].time > REMEMBERED || this.points.length >= MOST)) {
      this.points.shift();
    }
    if (last && separation(last.at, at) < APART) return false;
    this.points.push({ time, at });
    return true;
  }

  clear() {
    this.points = [];
  }

  /** How old a point is: from 0, just now, to 1, about to be forgotten. */
  static age(point, time) {
    return Math.min(1, Math.max(0, (time - point.time) / REMEMBERED));
  }
}
