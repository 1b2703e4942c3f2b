/**
 * The stars and constellation figures, loaded once from `data/stars.json`.
 *
 * Stars are in flat arrays, the brightest first, so that a chart can stop where they become too faint.
 */
import { vector } from "./sphere.js";

/** The colour index (B-V) below which a star is bluish, and above which it is reddish. */
const COOL = 0.15, WARM = 1.1;

export class Catalogue {
  /** @param {{stars: Array<[number, number, number, number, string?]>, figures: Array<any>}} data */
  constructor(data) {
    this.count = data.stars.length;
    this.vectors = new Float64Array(this.count * 3);
    this.magnitudes = new Float32Array(this.count);
    this.places = data.stars.map(([ra, dec]) => [ra, dec]);
    this.names = data.stars.map((row) => row[4] ?? "");
    /** 0 bluish, 1 white, 2 reddish. */
    this.tints = new Uint8Array(this.count);
    data.stars.forEach(([ra, dec, magnitude, colour], index) => {
      this.vectors.set(vector(ra, dec), index * 3);
      this.magnitudes[index] = magnitude;
      this.tints[index] = colour < COOL ? 0 : colour < WARM ? 1 : 2;
    });
    this.named = this.names.flatMap((name, index) => (name ? [index] : []));
    this.figures = data.figures.map(([name, ra, dec, lines]) => ({ name, at: vector(ra, dec), lines }));
  }
}

/** @returns {Promise<Catalogue>} */
export async function load(url = new URL("../../data/stars.json", import.meta.url)) {
  return new Catalogue(await (await fetch(url)).json());
}
