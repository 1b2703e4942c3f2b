// Formats angles (given in degrees) and times (given in Unix seconds) for display; unknown values become a dash.

export const UNKNOWN = "–";
const WINDS = ["N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW"];
const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
const two = (value) => String(value).padStart(2, "0");

const HOURS = ["h", "m", "s"], ARC = ["°", "′", "″"];
const sign = (value) => (value < 0 ? "−" : "+");

/** A non-negative value as whole hours or degrees, minutes and seconds, each with its mark. */
function sixtieths(value, marks, decimals = 0, wide = 2) {
  const unit = 10 ** decimals, seconds = Math.round(value * 3600 * unit) / unit;
  const parts = [String(Math.floor(seconds / 3600)).padStart(wide, "0"), two(Math.floor(seconds / 60) % 60), (seconds % 60).toFixed(decimals)];
  return `${parts[0]}${marks[0]} ${parts[1]}${marks[1]} ${parts[2].padStart(decimals ? decimals + 3 : 2, "0")}${marks[2]}`;
}

/** 279.46 -> 18h 37m 50s */
export function hours(degrees, decimals = 0) {
  if (!known(degrees)) return UNKNOWN;
  const value = (((degrees % 360) + 360) % 360) / 15, most = 24 - 0.5 / 3600 / 10 ** decimals;
  return sixtieths(value < most ? value : 0, HOURS, decimals);
}

/** 38.808 -> +38° 48′ 29″ */
export const declination = (degrees) => (known(degrees) ? sign(degrees) + sixtieths(Math.abs(degrees), ARC) : UNKNOWN);

/** -3.2 -> −0h 12m 48s */
export const hourAngle = (degrees) => (known(degrees) ? sign(degrees) + sixtieths(Math.abs(degrees) / 15, HOURS, 0, 1) : UNKNOWN);

/** A speed in degrees a second: 4 -> , 4.0°/s; 0.27 -> , 16′/s; 0.0042 -> , 15″/s */
export function speed(degrees) {
  if (!known(degrees)) return "";
  if (degrees >= 1) return `, ${degrees.toFixed(1)}°/s`;
  return degrees >= 1 / 60 ? `, ${Math.round(degrees * 60)}′/s` : `, ${Math.round(degrees * 3600)}″/s`;
}

/** -1.46 -> −1.5 */
export const magnitude = (value) => value.toFixed(1).replace("-", "−");

/** 76.62 -> 76.6° */
export const angle = (degrees, digits = 1) => (known(degrees) ? `${degrees.toFixed(digits).replace("-", "−")}°` : UNKNOWN);

/** 248.04 -> 248.0° WSW */
export const azimuth = (degrees) =>
  known(degrees) ? `${angle(degrees)} ${WINDS[Math.round(degrees / 22.5) % 16]}` : UNKNOWN;

const clockOf = (unix, options) => new Intl.DateTimeFormat(undefined, { hourCycle: "h23", ...options }).format(unix * 1000);

/** The local time of this device, hours and minutes. */
export const timeOfDay = (unix) => clockOf(unix, { hour: "2-digit", minute: "2-digit" });

/** The name of this device's time zone at a moment, as GMT+1 or CET. */
export const zone = (unix) =>
  new Intl.DateTimeFormat(undefined, { timeZoneName: "short" }).formatToParts(unix * 1000).find(({ type }) => type === "timeZoneName").value;

/** The local time of this device, with seconds. */
export const toSecond = (unix) => clockOf(unix, { hour: "2-digit", minute: "2-digit", second: "2-digit" });

/** 2026-11-22 14:55:13 UTC */
export const utc = (unix) => `${new Date(unix * 1000).toISOString().slice(0, 19).replace("T", " ")} UTC`;

/** A duration: 4 s, 3 min, 2 h 10 min, 5 days. */
export function span(seconds) {
  const whole = Math.abs(seconds);
  if (whole < 90) return `${whole < 9.95 && whole % 1 >= 0.05 ? whole.toFixed(1) : Math.round(whole)} s`;
  if (whole < 5400) return `${Math.round(whole / 60)} min`;
  if (whole < 172800) return `${Math.floor(whole / 3600)} h ${Math.round((whole % 3600) / 60)} min`;
  return `${Math.round(whole / 86400)} days`;
}

/** Make a sentence: a capital at the beginning and a full stop at the end. */
export function sentence(words) {
  const text = words.trim();
  return text ? text[0].toUpperCase() + text.slice(1) + (/[.!?…]$/.test(text) ? "" : ".") : "";
}
