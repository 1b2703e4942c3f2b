/**
 * Keys of the chart: arrow keys move a cross, Enter picks the object under it, + and - zoom, 0 resets.
 *
 * Other keys are left to the page: Escape and Space stop the mount everywhere.
 */

/** How far a key press moves the cross, as a fraction of the chart's radius; and with Shift. */
const STEP = 0.06, FINE = 0.015;
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/**
 * @param {HTMLCanvasElement} canvas
 * @param {{move: (right: number, down: number) => void, pick: () => void, enlarge: (factor: number) => void,
 *   reset: () => void, leave: () => void}} acts
 */
export function keys(canvas, acts) {
  const simple = { Enter: acts.pick, "+": () => acts.enlarge(1.5), "=": () => acts.enlarge(1.5),
    "-": () => acts.enlarge(1 / 1.5), 0: acts.reset };
  const press = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const way = WAYS[event.key], step = event.shiftKey ? FINE : STEP;
    if (way) acts.move(way[0] * step, way[1] * step);
    else if (simple[event.key]) simple[event.key]();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  canvas.addEventListener("keydown", press);
  canvas.addEventListener("blur", acts.leave);
}
