/**
 * The scene to draw: the state of the mount from the server, converted to its horizon at this moment.
 *
 * Between two messages the sky continues to turn. If site and sidereal time are unknown, `sky` is null; altitude and
 * azimuth reported by the mount are shown nevertheless.
 */
import { TURN, angles, horizon, precession, product, reversed, turned, vector } from "./sphere.js";

/** @typedef {{name: string, ra2000: number, dec2000: number, alt: number|null, at: number[]}} Body */

/** Into how many steps the path of a goto is divided. */
const STEPS = 24;

export class Scene {
  /**
   * @param {any} mount the state of a mount from the server
   * @param {number} age its age, seconds
   * @param {number} unix the time, for the precession
   */
  constructor(mount, age, unix) {
    this.mount = mount;
    this.unix = unix;
    const known = mount?.site != null && mount.sidereal != null;
    this.latitude = known ? mount.site.latitude : null;
    this.sidereal = known ? mount.sidereal + age * TURN : null;
    this.ofDate = known ? horizon(this.sidereal, this.latitude) : null;
    /** The rotation from J2000 to the horizon. */
    this.sky = known ? product(this.ofDate, precession(unix)) : null;
    this.tube = over(mount?.position);
    /** Whether the mount knows where it points. */
    this.sure = mount?.aligned !== false && mount?.state !== "down";
    this.target = over(mount?.target);
    this.way = this.#expectedWay(mount ?? {});
    /** @type {Body[]} */
    this.bodies = known
      ? (mount.bodies ?? []).map((body) => ({ ...body, at: turned(this.sky, vector(body.ra2000, body.dec2000)) }))
      : [];
  }

  /** The expected path of a goto. Both axes turn at once: in azimuth and altitude on an alt-az fork, else in the sky's. */
  #expectedWay({ position: from, target: to, equatorial }) {
    if (from?.alt == null || to?.alt == null) return [];
    const polar = this.ofDate && equatorial && to.ra != null, [across, above] = polar ? ["ra", "dec"] : ["az", "alt"];
    const turn = ((to[across] - from[across] + 540) % 360) - 180, rise = to[above] - from[above];
    const along = (part) => vector(from[across] + turn * part, from[above] + rise * part);
    return Array.from({ length: STEPS + 1 }, (_, step) => (polar ? turned(this.ofDate, along(step / STEPS)) : along(step / STEPS)));
  }

  /** The direction over the horizon of a J2000 position; null while the sky is unknown. */
  place(ra2000, dec2000) {
    return this.sky && turned(this.sky, vector(ra2000, dec2000));
  }

  /** Right ascension and declination of date of an azimuth and altitude; null while the sky is unknown. */
  ofDateAt(az, alt) {
    return this.ofDate && angles(turned(reversed(this.ofDate), vector(az, alt)));
  }

  /** The direction over the horizon of an hour angle and declination of date. */
  atHourAngle(angle, dec) {
    return turned(this.ofDate, vector(this.sidereal - angle, dec));
  }
}

function over(place) {
  return place?.alt == null || place.az == null ? null : vector(place.az, place.alt);
}
