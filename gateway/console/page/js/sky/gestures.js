/**
 * Gestures of fingers, mouse and wheel on the canvas: tap, drag, pinch, double tap.
 *
 * A finger that moves further than a trembling glove, or that a second finger has joined, is no tap.
 */

/** How far a tap may move, pixels; how long it may last, and the longest interval of a double tap, milliseconds. */
const TREMBLE = 10, SHORT = 600, TWICE = 320;
/** The largest distance to an object that is picked, pixels: for a finger, and for a mouse or pen. */
const REACH = { touch: 24, mouse: 14, pen: 14 };

/**
 * @param {HTMLCanvasElement} canvas
 * @param {{tap: (x: number, y: number, reach: number) => void, drag: (right: number, down: number) => void,
 *   enlarge: (factor: number, x: number, y: number) => void, reset: () => void, enlarged: () => boolean}} acts
 */
export function gestures(canvas, acts) {
  /** @type {Map<number, {x: number, y: number}>} */
  const down = new Map();
  let began = { x: 0, y: 0, time: 0 }, tapping = false, last = { x: 0, y: 0, time: -Infinity };

  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };

  const press = (event) => {
    if (event.button) return;
    canvas.setPointerCapture(event.pointerId);
    tapping = down.size === 0;
    down.set(event.pointerId, place(event));
    began = { ...place(event), time: event.timeStamp };
  };

  const move = (event) => {
    const before = down.get(event.pointerId);
    if (!before) return;
    const now = place(event);
    if (Math.hypot(now.x - began.x, now.y - began.y) > TREMBLE) tapping = false;
    if (down.size === 1 && !tapping) acts.drag(now.x - before.x, now.y - before.y);
    if (down.size === 2) {
      const [other] = [...down].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
      const ratio = Math.hypot(now.x - other.x, now.y - other.y) / Math.hypot(before.x - other.x, before.y - other.y);
      if (Number.isFinite(ratio) && ratio > 0) acts.enlarge(ratio, (now.x + other.x) / 2, (now.y + other.y) / 2);
      acts.drag((now.x - before.x) / 2, (now.y - before.y) / 2);
    }
    if (down.size > 1 || !tapping) down.set(event.pointerId, now);
  };

  const release = (event) => {
    if (!down.delete(event.pointerId)) return;
    if (!tapping || event.timeStamp - began.time > SHORT) return;
    const { x, y } = began, time = event.timeStamp;
    const again = time - last.time < TWICE && Math.hypot(x - last.x, y - last.y) < 3 * TREMBLE;
    last = { x, y, time: again ? -Infinity : time };
    if (again && acts.enlarged()) acts.reset();
    else if (!again) acts.tap(x, y, REACH[event.pointerType] ?? REACH.mouse);
  };

  const cancel = (event) => {
    down.delete(event.pointerId);
    tapping = false;
  };

  const wheel = (event) => {
    event.preventDefault();
    const { x, y } = place(event), lines = event.deltaMode === 1 ? 24 : 1;
    acts.enlarge(Math.exp(-event.deltaY * lines * 0.002), x, y);
  };

  const heard = { pointerdown: press, pointermove: move, pointerup: release, pointercancel: cancel, wheel };
  for (const [name, act] of Object.entries(heard)) canvas.addEventListener(name, act, { passive: false });
}
