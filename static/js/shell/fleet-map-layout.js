// Where all cars are, on one plane: metres from a common place, a scale that holds, and where names find room. No DOM.

import { offsetOf, placeOf } from '../core/geodesy.js';
import { isLost } from './fleet-layout.js';
import { counted, duration } from '../core/format.js';

/**
 * @typedef {import('../core/geodesy.js').Place} Place
 * @typedef {{left: number, top: number, width: number, height: number}} Box
 * @typedef {{east_m: number, north_m: number, m_per_px: number}} View the middle, and the scale
 *
 * @typedef {object} Dot a car on the map
 * @property {string} name
 * @property {number} east_m
 * @property {number} north_m
 * @property {number | null} turn_deg clockwise from north; null: not known
 * @property {boolean} isLive it may be shown as where it is
 * @property {number} age_s of the position
 * @property {'crit' | 'warn' | ''} kind
 * @property {boolean} isFlood
 */

/** Farther than this from the middle of the others is not drawn: it would make all of them one point [m]. */
const FAR_M = 50_000;
/** The least that the picture shows [m]. */
const LEAST_M = 120;
/** A position older than this is where the car was [s]. */
const LIVES_S = 3;
const STEPS = [1, 2, 5];

/**
 * @param {import('./fleet-layout.js').Seen} seen
 * @param {Map<string, 'crit' | 'warn' | ''>} kinds of the cars that need a person
 * @param {Set<string>} floods cars of a flood
 * @param {Place | null} from the place from which all are measured; null: it is to be chosen
 * @returns {{dots: Dot[], far: string[], without: string[], from: Place | null}}
 */
export function dotsOf(seen, kinds, floods, from) {
  const dots = [];
  const without = [];
  for (const car of seen.cars?.cars ?? []) {
    const kept = seen.kept.get(car.name);
    const found = kept?.summary.place;
    const place = placeOf(found);
    if (!kept || !found || !place) {
      without.push(car.name);
      continue;
    }
    from ??= place;
    const age_s = (found.age_s ?? 0) + Math.max(0, seen.page_ms - kept.at_ms) / 1000;
    const isFresh = found.freshness === 'fresh' || found.freshness === 'ageing';
    dots.push({
      name: car.name, ...offsetOf(from, place), turn_deg: found.heading_rad === null ? null : 90 - (found.heading_rad * 180) / Math.PI,
      isLive: isFresh && age_s <= LIVES_S && !isLost(car, seen.lag_s), age_s, kind: kinds.get(car.name) ?? '', isFlood: floods.has(car.name),
    });
  }
  const [east, north] = [middle(dots.map(({ east_m }) => east_m)), middle(dots.map(({ north_m }) => north_m))];
  const isFar = (/** @type {Dot} */ dot) => Math.hypot(dot.east_m - east, dot.north_m - north) > FAR_M;
  return { dots: dots.filter((dot) => !isFar(dot)), far: dots.filter(isFar).map(({ name }) => name), without, from };
}

/** @param {number[]} values */
function middle(values) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)] ?? 0;
}

/**
 * The picture that holds them all; the one before where it still does, so that nothing moves but cars.
 * @param {Dot[]} dots
 * @param {number} width_px
 * @param {number} height_px
 * @param {View | null} before
 * @returns {View}
 */
export function viewOf(dots, width_px, height_px, before) {
  const [inner_w, inner_h] = [Math.max(40, width_px - 140), Math.max(40, height_px - 90)];
  const easts = dots.map(({ east_m }) => east_m);
  const norths = dots.map(({ north_m }) => north_m);
  const [west, east, south, north] = dots.length ? [Math.min(...easts), Math.max(...easts), Math.min(...norths), Math.max(...norths)] : [0, 0, 0, 0];
  const [east_m, north_m] = [(west + east) / 2, (south + north) / 2];
  const m_per_px = Math.max(LEAST_M / Math.min(inner_w, inner_h), (east - west) / inner_w, (north - south) / inner_h);
  if (before && before.m_per_px >= m_per_px && before.m_per_px < 1.7 * m_per_px) {
    const [half_w, half_h] = [(before.m_per_px * (width_px - 80)) / 2, (before.m_per_px * (height_px - 60)) / 2];
    const holds = west >= before.east_m - half_w && east <= before.east_m + half_w && south >= before.north_m - half_h && north <= before.north_m + half_h;
    if (holds) return before;
  }
  return { east_m, north_m, m_per_px: 1.12 * m_per_px };
}

/** A round length of at least so many pixels: grid and scale bar [m]. @param {View} view @param {number} [least_px] */
export function stepOf({ m_per_px }, least_px = 56) {
  const least_m = least_px * m_per_px;
  for (let power = 10 ** Math.floor(Math.log10(least_m)); ; power *= 10) {
    for (const step of STEPS) if (step * power >= least_m) return step * power;
  }
}

/** @param {number} step_m */
export function lengthWords(step_m) {
  return step_m >= 1000 ? `${step_m / 1000} km` : `${step_m} m`;
}

/**
 * Places of names, none over another nor over a car: right, left, below or above of it; left out where there is none.
 * @param {{name: string, x: number, y: number, width: number, around: number}[]} wanted the most important first
 * @param {{x: number, y: number}[]} taken middles of all cars
 * @param {number} width_px
 * @param {number} height_px
 * @returns {Map<string, {x: number, y: number, anchor: 'start' | 'end' | 'middle'}>}
 */
export function namesAt(wanted, taken, width_px, height_px) {
  /** @type {Box[]} */
  const used = taken.map(({ x, y }) => ({ left: x - 7, top: y - 7, width: 14, height: 14 }));
  const found = new Map();
  for (const { name, x, y, width, around } of wanted) {
    const ways = /** @type {const} */ ([['start', x + around + 6, y], ['end', x - around - 6, y], ['middle', x, y + around + 12], ['middle', x, y - around - 12]]);
    for (const [anchor, at_x, at_y] of ways) {
      const left = anchor === 'start' ? at_x : anchor === 'end' ? at_x - width : at_x - width / 2;
      const box = { left, top: at_y - 9, width, height: 18 };
      const isInside = box.left >= 2 && box.left + width <= width_px - 2 && box.top >= 2 && box.top + 18 <= height_px - 2;
      if (!isInside || used.some((other) => overlaps(box, other))) continue;
      used.push(box);
      found.set(name, { x: at_x, y: at_y, anchor });
      break;
    }
  }
  return found;
}

/** @param {Box} a @param {Box} b */
function overlaps(a, b) {
  return a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;
}

/**
 * The text in the head of the map.
 * @param {number} cars
 * @param {Dot[]} dots
 * @param {string[]} without
 * @param {string[]} far
 */
export function mapWords(cars, dots, without, far) {
  const old = dots.filter(({ isLive }) => !isLive);
  const parts = [counted(cars, 'car')];
  if (old.length) parts.push(`${old.length} last seen ${duration(Math.max(...old.map(({ age_s }) => age_s)))} ago`);
  if (without.length) parts.push(`${counted(without.length, 'car')} without a position`);
  if (far.length) parts.push(`${far.length} farther than 50 km`);
  return parts.join(', ');
}
