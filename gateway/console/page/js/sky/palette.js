/**
 * The chart's colours: custom properties of CSS (`css/sky.css`), so that day and night are told in one place.
 *
 * By night every one of them is pure red. What is drawn between two of them is then pure red as well, edges included.
 */

/** Every colour by its name here; `--sky-` and the name in small letters is the property. */
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
