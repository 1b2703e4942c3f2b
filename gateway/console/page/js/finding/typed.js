// Reads a place on the sky that was typed. What can be meant in two ways is never guessed: it is asked, with each meaning
// written so that it has only one. Right ascension and declination are of date, as at the shell and in Python, unless
// J2000 stands behind them.

import { declination, hours } from "../core/format.js";

const SIGN = /[+\-−–]/;
const PLACE = /^[\d\s.:hmsd°'′’"″”+\-−–,;]+$/i;
const EQUINOX = /[\s(]*\b(?:(j ?2000(?:\.0)?|icrs)|(of date|j ?now))\)?\s*$/i;
const LIKE = "05:34:32 +22:00:52";

/** Say why a text is refused. */
class Unclear extends Error {}

/** The numbers of an angle as one; how many there were. */
function angle(text, what) {
  const numbers = text.match(/\d+(?:\.\d*)?|\.\d+/g) ?? [];
  if (!numbers.length || numbers.length > 3) throw new Unclear(`Write ${what} with up to three numbers, like ${LIKE}.`);
  if (numbers.slice(0, -1).some((number) => number.includes("."))) throw new Unclear(`Only the last number of ${what} can have a fraction.`);
  const [whole, minutes = 0, seconds = 0] = numbers.map(Number);
  if (minutes >= 60 || seconds >= 60) throw new Unclear(`Minutes and seconds go from 0 to 59 in ${what}.`);
  return { value: whole + minutes / 60 + seconds / 3600, count: numbers.length };
}

/** Right ascension and declination as two texts; null if one cannot tell where the second begins. */
function halves(text) {
  const at = text.search(SIGN);
  if (at >= 0) return [text.slice(0, at), text.slice(at)];
  const units = /^(.+?)[\s,;]+(\d+(?:\.\d*)?\s*[d°].*)$/i.exec(text);
  for (const parts of [text.split(/[,;]/), units?.slice(1) ?? []]) {
    if (parts.length === 2 && parts.every((part) => /\d/.test(part))) return parts;
  }
  const groups = text.split(/\s+/);
  return groups.length % 2 ? null : [groups.slice(0, groups.length / 2).join(" "), groups.slice(groups.length / 2).join(" ")];
}

/** What a right ascension can mean, in degrees. */
function rightAscensions(text) {
  const { value, count } = angle(text, "right ascension");
  const inHours = /h/i.test(text), inDegrees = /[d°]/i.test(text);
  if (inDegrees || (count === 1 && value > 24 && !inHours)) {
    if (value > 360) throw new Unclear("Right ascension goes to 24 hours, or 360 degrees.");
    return [value % 360];
  }
  if (value >= 24) throw new Unclear("Right ascension goes to 24 hours.");
  return count > 1 || inHours ? [value * 15] : [value * 15, value];
}

function equatorial(text, j2000) {
  const parts = halves(text);
  if (!parts) throw new Unclear(`Write the declination with its sign, like ${LIKE}.`);
  const ras = rightAscensions(parts[0]), signed = SIGN.test(parts[1]);
  if (SIGN.test(parts[1].replace(SIGN, ""))) throw new Unclear(`Write one sign, that of the declination, like ${LIKE}.`);
  const { value } = angle(parts[1], "declination");
  if (value > 90) throw new Unclear("Declination goes from −90 to +90 degrees.");
  const decs = !signed && value ? [value, -value] : [/[−–-]/.test(parts[1]) ? -value : value];
  const meant = ras.flatMap((ra) => decs.map((dec) => ({ ra, dec, j2000 })));
  if (meant.length === 1) return meant[0];
  const asked = [ras.length > 1 && "hours or degrees", decs.length > 1 && "north or south"].filter(Boolean).join(", ");
  const equinox = j2000 === null ? "" : j2000 ? " J2000" : " of date";
  return { asks: `Which one: ${asked}?`, choices: meant.map((one) => `${hours(one.ra, 1)} ${declination(one.dec)}${equinox}`) };
}

function horizontal(alt, az) {
  const altitude = angle(alt, "altitude").value * (/[−–-]/.test(alt) ? -1 : 1), azimuth = angle(az, "azimuth").value;
  if (Math.abs(altitude) > 90) throw new Unclear("Altitude goes to 90 degrees.");
  if (azimuth > 360 || SIGN.test(az)) throw new Unclear("Azimuth goes from 0 to 360 degrees, from north through east.");
  return { alt: altitude, az: azimuth % 360 };
}

/**
 * @param {string} text
 * @returns {{ra: number, dec: number, j2000: boolean | null} | {alt: number, az: number} | {asks: string, choices: string[]} | null}
 *   degrees; `j2000` null if the text does not say it; `asks` why it cannot be taken, and what it may mean; null: a name
 */
export function typedPlace(text) {
  const equinox = EQUINOX.exec(text);
  const plain = text.slice(0, equinox?.index).replace(/\b(ra|dec)\b[:=]?/gi, " ").trim();
  const [, alt, az] = /^alt\S*?[\s:=]+([\d\s.:°'′″"+\-−–]+?)[,;\s]+az\S*?[\s:=]+(.+)$/i.exec(plain) ?? [];
  const [, first, second] = /^az\S*?[\s:=]+([\d\s.:°'′″"]+?)[,;\s]+alt\S*?[\s:=]+(.+)$/i.exec(plain) ?? [];
  try {
    if (alt ?? first) return alt ? horizontal(alt, az) : horizontal(second, first);
    if (!PLACE.test(plain) || !/^[\d.+\-−–]/.test(plain) || (plain.match(/\d+/g) ?? []).length < 2) return null;
    if (SIGN.test(plain[0])) throw new Unclear(`Right ascension comes first and has no sign, like ${LIKE}.`);
    return equatorial(plain, equinox ? Boolean(equinox[1]) : null);
  } catch (error) {
    if (error instanceof Unclear) return { asks: error.message, choices: [] };
    throw error;
  }
}
