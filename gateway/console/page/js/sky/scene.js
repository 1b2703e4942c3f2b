/**
 * What is to be drawn now: the mount as the server told it, put over its horizon at this moment.
 *
 * Between two messages the sky turns on by itself. Without a site and its sidereal time there is no sky, and `sky` is
 * null; what the mount tells as altitude and azimuth is there all the same.
 */
import { TURN, horizon, precession, product, turned, vector } from "./sphere.js";

/** @typedef {{name: string, ra2000: number, dec2000: number, alt: number|null, at: number[]}} Body */

export class Scene {
  /**
   * @param {any} mount the server's view of a mount
   * @param {number} age seconds since it was told
   * @param {number} unix the time, for the precession
   */
  constructor(mount, age, unix) {
    this.mount = mount;
    this.unix = unix;
    const known = mount?.site != null && mount.sidereal != null;
    this.latitude = known ? mount.site.latitude : null;
    this.sidereal = known ? mount.sidereal + age * TURN : null;
    this.ofDate = known ? horizon(this.sidereal, this.latitude) : null;
    /** From J2000 to the horizon. */
    this.sky = known ? product(this.ofDate, precession(unix)) : null;
    this.tube = over(mount?.position);
    this.target = over(mount?.target);
    this.way = (mount?.way ?? []).map(([azimuth, altitude]) => vector(azimuth, altitude));
    /** @type {Body[]} */
    this.bodies = known
      ? (mount.bodies ?? []).map((body) => ({ ...body, at: turned(this.sky, vector(body.ra2000, body.dec2000)) }))
      : [];
  }

  /** A place of J2000 over the horizon; null where there is no sky. */
  place(ra2000, dec2000) {
    return this.sky && turned(this.sky, vector(ra2000, dec2000));
  }

  /** Of a hour angle and a declination of date. */
  atHourAngle(angle, dec) {
    return turned(this.ofDate, vector(this.sidereal - angle, dec));
  }
}

function over(place) {
  return place?.alt == null || place.az == null ? null : vector(place.az, place.alt);
}
