// Numbers and times as the operator reads them: pure functions, no DOM.

import { local } from './decimal.js';

export const NOTHING = '–';

/**
 * A number with a fixed count of decimals, the decimal mark of this browser's language and a true minus sign; never "−0.0". Unknown is a dash, never 0.
 * @param {number | null | undefined} value
 * @param {number} [digits]
 */
export function fixed(value, digits = 1) {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  const text = Math.abs(value).toFixed(digits);
  return local(value < 0 && Number(text) !== 0 ? `−${text}` : text);
}

/**
 * As `fixed`, with its sign: "+0.3", "−0.3", "0.0".
 * @param {number | null | undefined} value
 * @param {number} [digits]
 */
export function signed(value, digits = 1) {
  const text = fixed(value, digits);
  return value && value > 0 && Number(value.toFixed(digits)) !== 0 ? `+${text}` : text;
}

/**
 * Seconds that passed: "0.4", "12.3", from a minute on "2:05", from an hour on "1:02:05".
 * @param {number | null | undefined} seconds
 * @param {number} [digits] decimals below one second
 */
export function age(seconds, digits = 1) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NOTHING;
  const least = Math.max(0, seconds);
  if (least < 59.95) return fixed(least, least < 1 ? digits : 1);
  return duration(least);
}

/** How long something lasts, with its unit: "4.1 s", "12:05". @param {number} seconds */
export function ageWords(seconds) {
  return `${age(seconds)}${seconds < 59.95 ? ' s' : ''}`;
}

/**
 * "0:42", "12:05", "1:02:05".
 * @param {number} seconds
 * @param {boolean} [padded] two digits for the minutes, as a recorder counts
 */
export function duration(seconds, padded = false) {
  const whole = Math.max(0, Math.floor(seconds));
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const tail = `${String(minutes).padStart(hours || padded ? 2 : 1, '0')}:${String(rest).padStart(2, '0')}`;
  return hours ? `${hours}:${tail}` : tail;
}

/**
 * Time of day of a wall clock in milliseconds since 1970: "14:07:31".
 * @param {number | null | undefined} at_ms
 */
export function timeOfDay(at_ms) {
  if (at_ms === null || at_ms === undefined || !Number.isFinite(at_ms)) return NOTHING;
  const date = new Date(at_ms);
  return [date.getHours(), date.getMinutes(), date.getSeconds()].map((part) => String(part).padStart(2, '0')).join(':');
}

/**
 * Since when something is so, to the minute: "14:02", and "18 Nov, 14:02" where that is another day.
 * @param {number} at_ms
 */
export function sinceTime(at_ms) {
  const date = new Date(at_ms);
  const day = date.toDateString() === new Date().toDateString() ? '' : `${date.toLocaleDateString('en-GB', { day: 'numeric', month: 'short' })}, `;
  return `${day}${timeOfDay(at_ms).slice(0, 5)}`;
}

/**
 * A bearing in radians, counter-clockwise with 0 ahead, as degrees and a side.
 * @param {number | null | undefined} bearing_rad
 * @returns {{degrees: string, side: string} | null}
 */
export function bearing(bearing_rad) {
  if (bearing_rad === null || bearing_rad === undefined || !Number.isFinite(bearing_rad)) return null;
  const degrees = Math.round((bearing_rad * 180) / Math.PI);
  return { degrees: `${Math.abs(degrees)}°`, side: degrees === 0 ? 'ahead' : degrees > 0 ? 'left' : 'right' };
}

const COMPASS = ['N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'];

/**
 * A heading in degrees, clockwise from north: {"087°", "E"}.
 * @param {number} heading_deg
 */
export function heading(heading_deg) {
  const turned = ((heading_deg % 360) + 360) % 360;
  return { degrees: `${String(Math.round(turned) % 360).padStart(3, '0')}°`, point: COMPASS[Math.round(turned / 45) % 8] ?? '' };
}

/**
 * One thing of many: "1 alarm", "2 alarms".
 * @param {number} count
 * @param {string} one
 * @param {string} [many]
 */
export function counted(count, one, many = `${one}s`) {
  return `${count} ${count === 1 ? one : many}`;
}

/** A version has a point in every language. */
const VERSION = /\b(?:TLS|HTTP|[Vv]ersion)\s$/;
/** A number, and the unit behind it: what has three letters at most. */
const NUMBER = /(?<![\p{L}\d_/])([+−-]?\d+(?:[.:,]\d+)*°?)((?: (?:°C|[\p{L}%]{1,3}|\p{L}{4}(?=\/))(?:\/(?:s²?|h|min))?(?![\p{L}/]))?)(?![\p{L}\d_]|[.:,]\d)/gu;

/**
 * A sentence cut into numbers and the rest, so that numbers can stand in their own face and on one line with their unit, each
 * with the decimal mark of this browser's language.
 * @param {string} sentence
 * @returns {{text: string, unit?: string}[]} unit: of a number, with the space before it; empty where it has none
 */
export function pieces(sentence) {
  const found = [];
  let from = 0;
  for (const match of sentence.matchAll(NUMBER)) {
    if (match.index > from) found.push({ text: sentence.slice(from, match.index) });
    const [, text = '', unit = ''] = match;
    const isDecimal = /^[+−-]?\d+\.\d+°?$/.test(text) && !VERSION.test(sentence.slice(0, match.index));
    found.push({ text: isDecimal ? local(text) : text, unit });
    from = match.index + match[0].length;
  }
  if (from < sentence.length) found.push({ text: sentence.slice(from) });
  return found;
}

/**
 * A distance as it is read: "10.4 m", "320 m", "4.2 km".
 * @param {number} value_m
 * @returns {[string, string]} number and unit
 */
export function distanceWords(value_m) {
  if (value_m < 99.95) return [fixed(value_m), 'm'];
  if (value_m < 999.5) return [fixed(value_m, 0), 'm'];
  return [fixed(value_m / 1000, value_m < 99_950 ? 1 : 0), 'km'];
}
