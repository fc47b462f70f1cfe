// How far the car may have driven since its last value, as monitor/unseen.py has it: |v|·t + a·t²/2.

import { fixed } from './format.js';
import { speedIn, speedUnit } from './units.js';

/** Remote driving in Germany (StVFernLV): 200 ms at 50 km/h, that is 2.78 m. */
export const KEPT_M = 2.78;
export const LATE_ABOVE_S = 0.2;

/** @typedef {number | null | undefined} Known null, undefined: not known */

/**
 * The most metres that the car can have driven since its speed was measured; null: not known, never 0 for it.
 * @param {Known} speed_mps the last one, with any sign
 * @param {Known} age_s how old it is, its way to the glass included
 * @param {Known} acceleration_mps2 the most that the car can do
 * @returns {number | null}
 */
export function unseenMetres(speed_mps, age_s, acceleration_mps2) {
  const [v, t, a] = /** @type {number[]} */ ([speed_mps, age_s, acceleration_mps2]);
  const isKnown = [v, t, a].every(Number.isFinite) && t >= 0 && a > 0;
  return isKnown ? Math.abs(v) * t + (a * t * t) / 2 : null;
}

/**
 * The constant speed at which the car drives KEPT_M while a value is under way; null: it is on time, or that is not known.
 * @param {Known} late_s
 * @returns {number | null}
 */
export function keptSpeed(late_s) {
  return Number.isFinite(late_s) && Number(late_s) > LATE_ABOVE_S ? KEPT_M / Number(late_s) : null;
}

/**
 * A bound as it is read, never rounded down: "≤ 2.8 m unseen".
 * @param {Known} metres
 */
export function unseenWords(metres) {
  if (typeof metres !== 'number') return 'distance driven unknown';
  if (metres > 999) return `≤ ${up(metres / 1000)} km unseen`;
  return `≤ ${metres > 99.9 ? Math.ceil(metres) : up(metres)} m unseen`;
}

const up = (/** @type {number} */ value) => fixed(Math.ceil(value * 10) / 10);

/**
 * The metres unseen at the glass, by the last speed that came; null: not known.
 * @param {import('./store.js').Store} store
 */
export function unseenOf(store) {
  return unseenMetres(store.signal('speed')?.value?.speed_mps, store.ink('speed').age_s, store.limit('unseen.acceleration_mps2'));
}

/**
 * The speed to hold on a late link, where the setting requires it, in two short lines: "≤ 11.1 m/s", "for 2.78 m".
 * @param {import('./store.js').Store} store
 * @returns {string[]} none: nothing is proposed
 */
export function proposalOf(store) {
  const { frame } = store;
  if (!frame || !store.limit('unseen.proposes_speed') || store.isSilent || store.chain.cut !== null) return [];
  const late_s = frame.link.most_late_s ?? frame.link.late_s; // an agent of an older version has one of them
  if (late_s === null) return ['delay', 'not known'];
  const kept_mps = keptSpeed(Math.round(1000 * (late_s + store.lag_s - Math.max(0, store.silence_s))) / 1000);
  return kept_mps === null ? [] : [`≤ ${fixed(Math.floor(speedIn(kept_mps) * 10) / 10)} ${speedUnit()}`, `for ${KEPT_M} m`];
}
