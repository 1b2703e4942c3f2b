/**
 * Text on the chart: earlier text has precedence, and text that would overlap it is left out.
 */

/** The free space around text, pixels. */
const AIR = 3;
export const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif";

export class Labels {
  /** @param {CanvasRenderingContext2D} context @param {import("../view.js").View} view */
  constructor(context, view) {
    this.context = context;
    this.view = view;
    this.taken = [];
    this.shade = "";
    /** Cached widths of text; on which side of its point each text was written last. */
    this.widths = new Map();
    this.sides = new Map();
  }

  /** Begin a new picture; the page's own text and buttons cover these areas, each [left, top, right, bottom]. */
  begin(covered, shade) {
    this.taken = [...covered];
    this.shade = shade;
  }

  /** Reserve an area where no text may be drawn. */
  keepFree(x, y, radius) {
    this.taken.push([x - radius, y - radius, x + radius, y + radius]);
  }

  /**
   * Write beside a point, within the sky: where it stood before, or to its right; without room there, to its left, below
   * or above it. What must be written stands in the nearest free line of the chart otherwise.
   * @param {{size: number, weight?: number, colour: string, gap?: number, must?: boolean, spacing?: number}} style
   */
  beside(x, y, text, style) {
    const gap = style.gap ?? 6, width = this.#width(text, style), half = style.size / 2;
    const places = [
      [x + gap, y - half], [x - gap - width, y - half],
      [x - width / 2, y + gap], [x - width / 2, y - gap - style.size],
      [x + gap, y + gap], [x + gap, y - gap - style.size], [x - gap - width, y + gap], [x - gap - width, y - gap - style.size],
    ];
    const before = places[this.sides.get(text)] ?? places[0];
    const fits = [before, ...places].find((place) => this.#inSky(place, width, style.size) && this.#free(place, width, style.size));
    this.sides.set(text, places.indexOf(fits ?? before));
    const found = fits ?? (style.must ? this.#nearest(places[0], width, style.size) : null);
    if (found) this.#write(found, width, text, style);
  }

  /** The free place of the chart that is nearest to one, line by line; undefined without any. */
  #nearest([left, top], width, height) {
    const within = (place, most) => Math.max(2, Math.min(place, most - 2));
    const lines = Array.from({ length: Math.ceil((2 * this.view.height) / height) }, (_, line) => (line % 2 ? 1 : -1) * Math.ceil(line / 2) * height);
    const places = lines.map((down) => [within(left, this.view.width - width), within(top + down, this.view.height - height)]);
    return places.find((place) => this.#free(place, width, height));
  }

  /** Write text centred on a point, if there is room. Returns whether there was. */
  over(x, y, text, style) {
    const width = this.#width(text, style), place = [x - width / 2, y - style.size / 2];
    const free = this.#free(place, width, style.size);
    if (free) this.#write(place, width, text, style);
    return free;
  }

  #free([left, top], width, height) {
    const right = left + width, bottom = top + height;
    if (left < 2 || top < 2 || right > this.view.width - 2 || bottom > this.view.height - 2) return false;
    return this.taken.every(([l, t, r, b]) => right + AIR < l || left - AIR > r || bottom < t || top > b);
  }

  /** Whether an area is completely inside the horizon. */
  #inSky([left, top], width, height) {
    const { x, y, scale } = this.view;
    const right = Math.max(Math.abs(left - x), Math.abs(left + width - x));
    const down = Math.max(Math.abs(top - y), Math.abs(top + height - y));
    return Math.hypot(right, down) < scale;
  }

  #write([left, top], width, text, style) {
    const { context } = this;
    this.#font(style);
    context.fillStyle = style.colour;
    context.textBaseline = "middle";
    context.textAlign = "left";
    // A dark edge, so that it is legible over stars and lines.
    context.strokeStyle = this.shade;
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeText(text, left, top + style.size / 2);
    context.fillText(text, left, top + style.size / 2);
    this.taken.push([left, top, left + width, top + style.size]);
  }

  #width(text, style) {
    const key = `${style.size} ${style.weight ?? 400} ${style.spacing ?? 0} ${text}`;
    let width = this.widths.get(key);
    if (width === undefined) {
      this.#font(style);
      width = this.context.measureText(text).width;
      this.widths.set(key, width);
    }
    return width;
  }

  #font(style) {
    this.context.font = `${style.weight ?? 400} ${style.size}px ${FONT}`;
    if ("letterSpacing" in this.context) this.context.letterSpacing = `${style.spacing ?? 0}px`;
  }
}
