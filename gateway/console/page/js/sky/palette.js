/**
 * The chart's colours: custom properties of CSS (`css/sky.css`), so that day and night are defined in one place.
 *
 * By night each of them is pure red, so blends of two of them are pure red too, smoothed edges included.
 */

/** The names of the colours; their properties are `--sky-` and the name in lower case. */
const NAMES = [
  "zenith", "horizon", "ring", "rim", "grid", "letters", "star", "star-cool", "star-warm", "name", "figure", "figure-name",
  "sun", "moon", "moon-dark", "planet", "forbidden", "forbidden-edge", "tube", "trail", "way", "target", "chosen",
  "shade",
];

/** @param {Element} element @returns {Record<string, string>} */
export function palette(element) {
  const style = getComputedStyle(element);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--sky-${name}`).trim() || "#800000"]));
}
