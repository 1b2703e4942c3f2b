/**
 * The cross that the arrow keys move: a point of the chart, stored as fractions of its radius from the zenith.
 */

/** The distance from the edge of the canvas at which the chart moves along, pixels. */
const ROOM = 40;

export class Cross {
  /** @param {import("./view.js").View} view */
  constructor(view) {
    this.view = view;
    /** @type {[number, number]|null} */
    this.place = null;
  }

  /** Its position on the canvas. */
  get point() {
    const { x, y, scale } = this.view;
    return [x + this.place[0] * scale, y + this.place[1] * scale];
  }

  /** Its direction over the horizon; null while the keys are not in use. */
  get vector() {
    return this.place && this.view.vector(...this.point);
  }

  /** Move it, not beyond the rim, and keep it visible. */
  move(right, down) {
    const [x, y] = this.place ?? [0, 0], next = [x + right / this.view.zoom, y + down / this.view.zoom];
    const far = Math.max(1, Math.hypot(...next));
    this.place = [next[0] / far, next[1] / far];
    const [px, py] = this.point, { width, height } = this.view;
    this.view.pan(
      Math.max(0, ROOM - px) - Math.max(0, px - width + ROOM), Math.max(0, ROOM - py) - Math.max(0, py - height + ROOM),
    );
  }

  leave() {
    this.place = null;
  }
}
