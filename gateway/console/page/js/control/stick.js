// What a gamepad asks for at a moment. It moves the mount only while a shoulder button is held, and only after its stick
// was seen at the centre; a gamepad that hangs, whose values no longer change, moves nothing after a few seconds.

/** The part of a stick's way that is its centre; an axis counts if it has this part of the larger one. */
const CENTRE = 0.15, ASLANT = 0.4;
/** Buttons of the standard layout. */
const STOP = 1, SHOULDERS = [4, 5], SLOWER = 13, FASTER = 12;
/** Degrees a second above which a rate is fast; milliseconds without any change that end a motion, fast or not. */
const FAST = 0.5, STILL_FAST = 5000, STILL_SLOW = 30000;

const down = (pad, button) => Boolean(pad.buttons[button]?.pressed);

export class Stick {
  #centred = false;
  #values = "";
  #changedAt = 0;
  #buttons = new Set();

  /** Forget that the stick was at its centre: whatever ended the motion, it must go back there first. */
  reset() {
    this.#centred = false;
  }

  /**
   * @param {{axes: readonly number[], buttons: readonly {pressed: boolean, value: number}[]}} pad
   * @param {number} now  milliseconds
   * @param {number|null} speed  degrees a second at the chosen rate; null counts as fast
   * @returns {{places: string[], stop: boolean, faster: number}} the places of the arrows (`up`, `left` …) that are held,
   *   whether STOP was pressed, and by how much the rate changes
   */
  take(pad, now, speed) {
    const values = JSON.stringify([pad.axes, pad.buttons.map((one) => [one.pressed, one.value])]);
    if (values !== this.#values) [this.#values, this.#changedAt] = [values, now];
    const pressed = [STOP, SLOWER, FASTER].filter((button) => down(pad, button) && !this.#buttons.has(button));
    this.#buttons = new Set([STOP, SLOWER, FASTER].filter((button) => down(pad, button)));
    const [right, below] = [pad.axes[0] ?? 0, pad.axes[1] ?? 0], most = Math.max(Math.abs(right), Math.abs(below));
    if (now - this.#changedAt > (speed !== null && speed <= FAST ? STILL_SLOW : STILL_FAST)) this.reset();
    if (pressed.includes(STOP)) this.reset();
    else if (most < CENTRE) this.#centred = true;
    const moves = this.#centred && most >= CENTRE && SHOULDERS.some((button) => down(pad, button));
    const counts = (value) => moves && Math.abs(value) >= CENTRE && Math.abs(value) >= ASLANT * most;
    return {
      places: [counts(below) && (below < 0 ? "up" : "down"), counts(right) && (right < 0 ? "left" : "right")].filter(Boolean),
      stop: pressed.includes(STOP),
      faster: pressed.includes(FASTER) - pressed.includes(SLOWER),
    };
  }
}
