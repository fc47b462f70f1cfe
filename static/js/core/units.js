// Speeds as this phone's operator reads them: m/s, km/h or mph. On the wire and in every file they stay m/s.

import { fixed } from './format.js';

/** @typedef {'m/s' | 'km/h' | 'mph'} SpeedUnit */

const KEPT = 'catgraph.speed-unit';

/** How many of each unit are one m/s, by definition: 3600 s an hour, 1609.344 m a mile; and how it is spoken. */
export const SPEED_UNITS = /** @type {Record<SpeedUnit, {factor: number, spoken: string}>} */ ({
  'm/s': { factor: 1, spoken: 'metres a second' },
  'km/h': { factor: 3.6, spoken: 'kilometres an hour' },
  mph: { factor: 3600 / 1609.344, spoken: 'miles an hour' },
});

/** @type {SpeedUnit} */
let chosen = kept();

/** The unit in which speeds are shown now. */
export function speedUnit() {
  return chosen;
}

/** As it is spoken: "kilometres an hour". */
export function spokenSpeedUnit() {
  return SPEED_UNITS[chosen].spoken;
}

/**
 * Show speeds in this unit from now on, on this phone. What draws seldom listens to the window's "catgraph-units".
 * @param {SpeedUnit} unit
 */
export function chooseSpeedUnit(unit) {
  chosen = unit;
  try {
    localStorage.setItem(KEPT, unit);
  } catch {
    // no storage: it holds until the page is loaded again
  }
  if (typeof window !== 'undefined') window.dispatchEvent(new Event('catgraph-units'));
}

/**
 * A speed in m/s as a number of the chosen unit; unknown stays unknown.
 * @template {number | null | undefined} T
 * @param {T} speed_mps
 * @returns {T}
 */
export function speedIn(speed_mps) {
  return /** @type {T} */ (typeof speed_mps === 'number' ? speed_mps * SPEED_UNITS[chosen].factor : speed_mps);
}

/**
 * A speed in m/s as it is read, "15.1", and its unit.
 * @param {number | null | undefined} speed_mps
 * @param {number} [digits]
 * @returns {[string, SpeedUnit]}
 */
export function speedWords(speed_mps, digits = 1) {
  return [fixed(speedIn(speed_mps), digits), chosen];
}

/**
 * Any quantity of the wire as it is shown: a speed in the chosen unit, everything else as it is.
 * @template {number | null | undefined} T
 * @param {T} value
 * @param {string} unit
 * @returns {{value: T, unit: string}}
 */
export function shownIn(value, unit) {
  return unit === 'm/s' ? { value: speedIn(value), unit: chosen } : { value, unit };
}

/**
 * The way back: a number of a shown unit as it goes over the wire, to a micrometre a second.
 * @param {number} value as shown
 * @param {string} unit of the wire
 */
export function wireOf(value, unit) {
  return unit === 'm/s' && chosen !== 'm/s' ? Number((value / SPEED_UNITS[chosen].factor).toFixed(6)) : value;
}

const NUMBER = '[+−-]?\\d+(?:[.,]\\d+)?'; // with a point by the server, with either by this page
const SPEEDS = new RegExp(`(?<![\\p{L}\\d_.,/:])(${NUMBER}(?: (?:to|→|of|or) ${NUMBER})*) m/s(?![\\p{L}\\d²^/_])`, 'gu');

/**
 * A sentence of the server with its speeds in the chosen unit: "12.6 m/s, limit 11.0 m/s" → "45.4 km/h, limit 39.6 km/h".
 * Larger stays larger; what is no speed stays as it is.
 * @param {string} sentence
 */
export function inUnits(sentence) {
  if (chosen === 'm/s' || !sentence.includes('m/s')) return sentence;
  return sentence.replaceAll(SPEEDS, (_, /** @type {string} */ numbers) => `${numbers.replaceAll(new RegExp(NUMBER, 'gu'), speedOf)} ${chosen}`);
}

/** One number of a sentence; a whole one stays without decimals where it can. @param {string} text */
function speedOf(text) {
  const digits = text.split(/[.,]/)[1]?.length ?? 0;
  const shown = fixed(speedIn(Number(text.replace('−', '-').replace(',', '.'))), Math.max(1, digits));
  const sign = text.startsWith('+') ? '+' : '';
  return sign + (digits ? shown : shown.replace(/[.,]0$/, ''));
}

/** @returns {SpeedUnit} */
function kept() {
  try {
    const unit = localStorage.getItem(KEPT);
    if (unit !== null && Object.hasOwn(SPEED_UNITS, unit)) return /** @type {SpeedUnit} */ (unit);
  } catch {
    // no storage, or no browser
  }
  return 'm/s';
}
