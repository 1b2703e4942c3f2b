/**
 * The sky chart on a canvas: it connects the state of the mount, the drawing, and the user's gestures and keys.
 *
 * It is drawn only when it would look different, at most once per animation frame. Between two messages the sky
 * continues to turn.
 */
import { load } from "./catalogue.js";
import { Cross } from "./cross.js";
import { gestures } from "./gestures.js";
import { keys } from "./keys.js";
import { palette } from "./palette.js";
import { Picture } from "./paint/picture.js";
import { pick } from "./pick.js";
import { Scene } from "./scene.js";
import { angles, DEGREE, TURN } from "./sphere.js";
import { Trail } from "./trail.js";
import { View } from "./view.js";
import { described, under } from "./words.js";

/** How far sky and tube may move before the chart is drawn again, pixels; the longest wait for that, seconds. */
const PATIENCE = 0.5, LONGEST = 30;
/** A larger difference from the expected sidereal time means another clock or site, degrees. */
const STRAY = 0.02;
/** The largest distance between the cross and the object it picks, pixels. */
const REACH = 16;
/** The azimuth at the bottom of the chart, by what is up. */
const BOTTOM = { north: 180, south: 0 };

/**
 * @typedef {{onPick?: (place: import("./pick.js").Place) => void, say?: (words: string) => void,
 *   palette?: Record<string, string>, catalogue?: Promise<import("./catalogue.js").Catalogue>,
 *   clock?: () => number, covered?: () => number[][]}} Options `onPick` receives what the user picks, `say` receives text for a live region;
 *   the default `palette` is that of `css/sky.css`; `clock` returns seconds; `covered` are areas with other text
 */

export class Sky {
  #canvas; #options; #clock; #colours; #picture; #cross;
  #view = new View();
  #trail = new Trail();
  #scene = new Scene(null, 0, 0);
  #catalogue = null;
  #mount = null;
  #told = 0;
  #up = "north";
  /** What the user has picked, or the page has marked. */
  #place = null;
  #frame = 0;
  #timer = 0;
  #words = "";
  /** What the last picture shows. */
  #drawn = { shape: "", tube: null };

  /** @param {HTMLCanvasElement} canvas @param {Options} options */
  constructor(canvas, options = {}) {
    this.#canvas = canvas;
    this.#options = options;
    this.#clock = options.clock ?? (() => performance.now() / 1000);
    this.#picture = new Picture(canvas, this.#view);
    this.#cross = new Cross(this.#view);
    this.#hearFingers();
    this.#hearKeys();
    canvas.classList.add("sky");
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-roledescription", "sky chart");
    this.setNight();
    this.resize();
    this.#load();
  }

  async #load() {
    try {
      this.#catalogue = await (this.#options.catalogue ?? load());
      this.#changed();
    } catch {
      this.#options.say?.("The stars could not be loaded; reload the page to try again.");
    }
  }

  // --- called by the page -------------------------------------------------------------------------------------------

  /** Set the state of the mount from the server. */
  update(mount) {
    const before = this.#mount, time = this.#clock(), at = mount.position;
    const another = before?.index !== mount.index, strays = another || this.#strays(mount.sidereal, time);
    if (another) this.#trail.clear();
    if (another || before.sidereal !== mount.sidereal) this.#told = time;
    this.#mount = mount;
    if (at?.alt != null) this.#trail.add(at.az, at.alt, time);
    if (strays || this.#drawn.shape !== shape(mount) || this.#moved()) this.#changed();
  }

  /** Mark a J2000 position, `{ra2000, dec2000, name}`; null removes the mark. */
  highlight(place) {
    this.#place = place;
    this.#changed();
  }

  /** Set what is up: "north", "south", or "zenith", with the direction of the tube at the bottom. */
  setUp(up) {
    this.#up = up;
    this.#view.face(BOTTOM[up] ?? this.#view.facing);
    this.#changed();
  }

  /** Use the page's colours again after they have changed. */
  setNight() {
    this.#colours = this.#options.palette ?? palette(this.#canvas);
    this.#changed();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    this.#canvas.width = Math.round(width * this.#density);
    this.#canvas.height = Math.round(height * this.#density);
    this.#view.resize(width, height);
    cancelAnimationFrame(this.#frame);
    this.#draw(); // at once, because a canvas whose size is set is empty
  }

  enlarge(factor, x = this.#view.width / 2, y = this.#view.height / 2) {
    this.#view.enlarge(factor, x, y);
    this.#changed();
  }

  reset() {
    this.#view.reset();
    this.#changed();
  }

  // --- drawing ------------------------------------------------------------------------------------------------------

  get #density() {
    return this.#canvas.ownerDocument.defaultView.devicePixelRatio || 1;
  }

  #changed() {
    if (!this.#frame) this.#frame = requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    this.#frame = 0;
    if (!this.#canvas.width || !this.#canvas.height) return;
    const time = this.#clock(), view = this.#view, place = this.#place;
    this.#look(time);
    if (this.#up === "zenith" && this.#scene.tube) view.face(angles(this.#scene.tube)[0]);
    this.#drawn = { shape: shape(this.#mount), tube: this.#scene.tube && view.point(this.#scene.tube) };
    this.#picture.draw({
      scene: this.#scene, catalogue: this.#catalogue, colours: this.#colours, trail: this.#trail, time,
      density: this.#density, cursor: this.#cross.vector, covered: this.#options.covered?.() ?? [],
      chosen: place && this.#scene.sky && { at: this.#scene.place(place.ra2000, place.dec2000), name: place.name },
    });
    clearTimeout(this.#timer);
    const turned = PATIENCE / view.scale / DEGREE / TURN;
    this.#timer = setTimeout(() => this.#changed(), Math.min(LONGEST, turned) * 1000);
  }

  /** Make the scene of this moment, and describe it in words. */
  #look(time) {
    this.#scene = new Scene(this.#mount, time - this.#told, Date.now() / 1000);
    const words = described(this.#scene);
    if (words !== this.#words) this.#canvas.setAttribute("aria-label", (this.#words = words));
  }

  /** Whether the sky has turned by more or less than the time that has passed. */
  #strays(sidereal, time) {
    if (this.#mount.sidereal == null || sidereal == null) return this.#mount.sidereal !== sidereal;
    const reckoned = this.#mount.sidereal + (time - this.#told) * TURN;
    return Math.abs(((reckoned - sidereal + 540) % 360) - 180) > STRAY;
  }

  /** Whether the reticle has moved. */
  #moved() {
    const before = this.#drawn.tube, tube = new Scene(this.#mount, 0, 0).tube;
    if (!before || !tube) return Boolean(before) !== Boolean(tube);
    const [x, y] = this.#view.point(tube);
    return Math.hypot(x - before[0], y - before[1]) > PATIENCE;
  }

  // --- gestures and keys --------------------------------------------------------------------------------------------

  #hearFingers() {
    gestures(this.#canvas, {
      tap: (x, y, reach) => this.#choose(x, y, reach),
      drag: (right, down) => {
        this.#view.pan(right, down);
        this.#changed();
      },
      enlarge: (factor, x, y) => this.enlarge(factor, x, y),
      reset: () => this.reset(),
      enlarged: () => this.#view.zoom > 1.01,
    });
  }

  #hearKeys() {
    keys(this.#canvas, {
      move: (right, down) => {
        this.#cross.move(right, down);
        this.#changed();
        this.#options.say?.(under(this.#at(...this.#cross.point, REACH)));
      },
      pick: () => this.#cross.place && this.#choose(...this.#cross.point, REACH),
      enlarge: (factor) => this.enlarge(factor, ...(this.#cross.place ? this.#cross.point : [])),
      reset: () => this.reset(),
      leave: () => {
        this.#cross.leave();
        this.#changed();
      },
    });
  }

  #at(x, y, reach) {
    this.#look(this.#clock());
    return pick({ view: this.#view, scene: this.#scene, catalogue: this.#catalogue, points: this.#picture.points },
      x, y, reach);
  }

  #choose(x, y, reach) {
    const found = this.#at(x, y, reach);
    if (!found) return;
    this.highlight(found);
    this.#options.onPick?.(found);
  }
}

/** What a picture depends on, except the time and the position of the tube. */
function shape(mount) {
  const { index, site, target, bodies, limits, equatorial, german, aligned, state } = mount ?? {};
  return JSON.stringify([index, site, target, bodies, limits, equatorial, german, aligned, state]);
}
