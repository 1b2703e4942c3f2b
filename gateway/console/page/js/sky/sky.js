/**
 * The sky chart on a canvas. Nothing is drawn unless something has changed, and never more than once a frame.
 *
 * `onPick` is told what somebody has picked; `say` gets words for a live region; `clock` gives seconds, for tests.
 */
import { load } from "./catalogue.js";
import { gestures } from "./gestures.js";
import { keys } from "./keys.js";
import { palette } from "./palette.js";
import { Picture } from "./paint/picture.js";
import { pick } from "./pick.js";
import { Scene } from "./scene.js";
import { angles, TURN } from "./sphere.js";
import { Trail } from "./trail.js";
import { View } from "./view.js";
import { described, under } from "./words.js";

/** Pixels by which the sky may turn before it is drawn anew; the chart never waits longer than this (seconds). */
const PATIENCE = 0.5, LONGEST = 30;
/** Pixels from the cross to what it picks. */
const REACH = 16;

/**
 * @param {HTMLCanvasElement} canvas
 * @param {{onPick?: (place: import("./pick.js").Place) => void, say?: (words: string) => void,
 *   palette?: Record<string, string>, catalogue?: Promise<import("./catalogue.js").Catalogue>,
 *   clock?: () => number}} options without a `palette` the colours are those of `css/sky.css`
 */
export function createSky(canvas, options = {}) {
  const { onPick = () => {}, say = () => {}, clock = () => performance.now() / 1000 } = options;
  const view = new View(), picture = new Picture(canvas, view), trail = new Trail();
  let colours = options.palette ?? palette(canvas), catalogue = null;
  let mount = null, told = clock(), up = "north";
  let scene = new Scene(null, 0, 0), place = null, cross = null, frame = 0, timer = 0, words = "", destroyed = false;

  const resize = () => {
    const { clientWidth: width, clientHeight: height } = canvas, density = density_();
    canvas.width = Math.round(width * density);
    canvas.height = Math.round(height * density);
    view.resize(width, height);
    changed();
  };
  const density_ = () => canvas.ownerDocument.defaultView.devicePixelRatio || 1;
  const changed = () => {
    if (!frame && !destroyed) frame = requestAnimationFrame(draw);
  };

  function draw() {
    frame = 0;
    const time = clock();
    look(time);
    if (up === "zenith") view.face(scene.tube ? angles(scene.tube)[0] : view.facing);
    picture.draw({
      scene, catalogue, colours, trail, time, density: density_(), cursor: cross && view.vector(...crossPoint()),
      chosen: place && scene.sky && { at: scene.place(place.ra2000, place.dec2000), name: place.name },
    });
    clearTimeout(timer);
    const turning = (PATIENCE / view.scale / TURN) * (180 / Math.PI);
    timer = setTimeout(changed, Math.min(LONGEST, turning) * 1000);
  }

  /** Put the mount over its horizon at this moment. */
  function look(time) {
    scene = new Scene(mount, time - told, Date.now() / 1000);
    const now = described(scene);
    if (now !== words) canvas.setAttribute("aria-label", (words = now));
  }

  const crossPoint = () => [view.x + cross[0] * view.scale, view.y + cross[1] * view.scale];
  const picked = (x, y, reach) => {
    look(clock());
    return pick({ view, scene, catalogue, points: picture.points }, x, y, reach);
  };
  const choose = (x, y, reach) => {
    const found = picked(x, y, reach);
    if (!found) return;
    place = found;
    changed();
    onPick(found);
  };
  const reset = () => {
    view.reset();
    changed();
  };
  const enlarge = (factor, x = view.width / 2, y = view.height / 2) => {
    view.enlarge(factor, x, y);
    changed();
  };
  const drag = (right, down) => {
    view.pan(right, down);
    changed();
  };

  const ends = [
    gestures(canvas, { tap: choose, drag, enlarge, reset, enlarged: () => view.zoom > 1.01 }),
    keys(canvas, {
      move: (right, down) => {
        const [x, y] = cross ?? [0, 0], next = [x + right / view.zoom, y + down / view.zoom];
        const far = Math.max(1, Math.hypot(...next));
        cross = next.map((value) => value / far);
        const [px, py] = crossPoint(), room = 40;
        view.pan(Math.max(0, room - px) - Math.max(0, px - view.width + room),
          Math.max(0, room - py) - Math.max(0, py - view.height + room));
        changed();
        say(under(picked(...crossPoint(), REACH)));
      },
      pick: () => cross && choose(...crossPoint(), REACH),
      enlarge: (factor) => enlarge(factor, ...(cross ? crossPoint() : [])),
      reset,
      leave: () => {
        cross = null;
        changed();
      },
    }),
  ];

  canvas.classList.add("sky");
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-roledescription", "sky chart");
  (options.catalogue ?? load()).then((found) => {
    catalogue = found;
    changed();
  }, () => say("The stars could not be loaded; reload the page to try again."));
  resize();

  return {
    /** What the server tells of the mount. */
    update(now) {
      const before = mount;
      if (before && before.index !== now.index) trail.clear();
      mount = now;
      if (before?.sidereal !== now.sidereal || before?.index !== now.index) told = clock();
      const at = now.position;
      if (at?.alt != null) trail.add(at.az, at.alt, clock());
      changed();
    },
    /** Mark a place of J2000, `{ra2000, dec2000, name}`; null takes the mark away. */
    highlight(found) {
      place = found;
      changed();
    },
    /** "north" or "south" is up, or the "zenith": then the direction in which the tube points lies at the bottom. */
    setUp(what) {
      up = what;
      view.face(up === "south" ? 0 : 180);
      changed();
    },
    /** The page's colours are others now. */
    setNight() {
      colours = options.palette ?? palette(canvas);
      changed();
    },
    enlarge, reset, resize,
    destroy() {
      destroyed = true;
      cancelAnimationFrame(frame);
      clearTimeout(timer);
      for (const end of ends) end();
    },
  };
}
