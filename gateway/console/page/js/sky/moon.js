/**
 * The phase of the Moon: how much of it is lit, and on which side, from the directions of Sun and Moon.
 */
import { dot } from "./sphere.js";

/** The lit fraction, from 0 (new) to 1 (full). @param {number[]} moon @param {number[]} sun */
export function lit(moon, sun) {
  return (1 - dot(moon, sun)) / 2;
}

/** The direction on the canvas from the Moon to the Sun, radians clockwise from the right. */
export function towards(view, moon, sun) {
  const part = dot(moon, sun), step = 0.01;
  const beside = moon.map((value, axis) => value + step * (sun[axis] - part * value));
  const length = Math.hypot(...beside);
  const [x, y] = view.point(moon), [x2, y2] = view.point(beside.map((value) => value / length));
  return Math.atan2(y2 - y, x2 - x);
}
