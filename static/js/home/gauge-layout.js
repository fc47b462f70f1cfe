// The geometry of the gauge: pure functions. ViewBox 380×250, centre 190,214, angle = 180°·v/V_max from the left.

import { fixed } from '../core/format.js';

export const CENTRE = /** @type {const} */ ({ x: 190, y: 214 });

/**
 * @typedef {object} Scale
 * @property {number} speed_max at the right end of the band, in the unit that is shown
 * @property {number} acceleration_max_mps2 at both ends of the inner arc
 * @property {number | null} limit the operator's limit, in the same unit
 *
 * @typedef {{d: string, isBig: boolean}} Tick
 * @typedef {{text: string, x: number, y: number}} Label
 *
 * @typedef {object} Face what stands still while the car moves
 * @property {string[]} tracks
 * @property {string[]} rungs of the ladder beyond the limit
 * @property {Tick[]} ticks
 * @property {Label[]} labels
 * @property {{line: string, wedge: string, text: string, x: number, y: number, anchor: 'start' | 'end'} | null} limit
 */

/**
 * Degrees on the speed band, 0 left and 180 right; what lies beyond the ends stays at the ends. Both in one unit.
 * @param {number} speed its size counts: reversing too fast is too fast
 * @param {number} speed_max
 */
export function speedAngle(speed, speed_max) {
  return clamp((180 * Math.abs(speed)) / speed_max, 0, 180);
}

/**
 * Degrees on the acceleration arc, −90…90 from its top, clockwise.
 * @param {number} acceleration_mps2
 * @param {number} acceleration_max_mps2
 */
export function accelerationAngle(acceleration_mps2, acceleration_max_mps2) {
  return clamp((90 * acceleration_mps2) / acceleration_max_mps2, -90, 90);
}

/**
 * The face of the gauge.
 * @param {Scale} scale
 * @returns {Face}
 */
export function faceOf({ speed_max, acceleration_max_mps2, limit }) {
  const end = limit !== null && limit > 0 ? speedAngle(limit, speed_max) : 180;
  const step = tickStep(speed_max);
  /** @type {Tick[]} */
  const ticks = [];
  /** @type {(Label & {degrees: number})[]} */
  const labels = [];
  for (let i = 0; i * step <= speed_max + 1e-9; i += 1) {
    const degrees = speedAngle(i * step, speed_max);
    const isBig = i % 5 === 0;
    ticks.push({ d: ray(degrees, isBig ? 154 : 162, 168), isBig });
    const label = numberAt(degrees, i * step);
    if (isBig && !isInTheWay(label)) labels.push(label);
  }
  if (speed_max % (5 * step) > 1e-9) {
    ticks.push({ d: ray(180, 154, 168), isBig: true });
    if (180 - (labels.at(-1)?.degrees ?? 0) > 9) labels.push(numberAt(180, speed_max));
  }
  for (const [degrees, isBig] of /** @type {[number, boolean][]} */ ([[90, true], [30, false], [60, false], [120, false], [150, false]])) {
    ticks.push({ d: isBig ? ray(90, 113, 130) : ray(degrees, 116, 120), isBig });
  }
  const ends = plain(acceleration_max_mps2);
  labels.push({ degrees: 0, text: `−${ends}`, x: 57, y: 188 }, { degrees: 180, text: `+${ends}`, x: 323, y: 188 });
  return {
    tracks: [
      `${arc(188, 0, end)}${arc(172, 0, end)}`,
      end < 180 ? arc(188, end, 180) : '', end < 180 ? arc(172, end, 180) : '',
      'M18 214L2 214', 'M362 214L378 214', arc(120, 0, 180),
    ].filter(Boolean),
    rungs: rungs(end),
    ticks,
    labels: labels.map(({ text, x, y }) => ({ text, x, y })),
    limit: limit !== null && limit > 0 ? limitMark(end, limit) : null,
  };
}

/**
 * The speed that is ordered now: an arc outside the band from it to the measured one, and its label where the limit's is not.
 * @param {number} ordered in one unit, as the others
 * @param {number | null} measured null: not known, so there is no arc
 * @param {number} speed_max
 * @param {number | null} limit
 */
export function orderMark(ordered, measured, speed_max, limit) {
  const [to, from] = [speedAngle(ordered, speed_max), measured === null ? null : speedAngle(measured, speed_max)];
  const isLimitLeft = limit !== null && limit > 0 && speedAngle(limit, speed_max) < 90;
  return {
    d: from === null || Math.abs(from - to) < 0.5 ? '' : arc(196, Math.min(from, to), Math.max(from, to)),
    x: isLimitLeft ? 364 : 16, y: 26, anchor: isLimitLeft ? 'end' : 'start',
  };
}

/**
 * How large the digits stand and how wide a block behind them must be.
 * @param {string} digits
 */
export function digitsBox(digits) {
  const size = digits.length <= 3 ? 110 : digits.length === 4 ? 100 : 80;
  const wide = [...digits].reduce((sum, letter) => sum + (letter === '.' || letter === ',' ? 0.22 : 0.56), 0) * size;
  const half = Math.ceil(wide / 2 + 9);
  return { size, x: CENTRE.x - half, width: 2 * half, unitX: digits.length <= 3 ? 278 : CENTRE.x + half + 5 };
}

/**
 * A quarter-filled ring as a path: the band from `from` to `to` degrees between two radii.
 * @param {number} inner
 * @param {number} outer
 * @param {number} from
 * @param {number} to
 */
export function band(inner, outer, from, to) {
  const [a, b, c, d] = [at(outer, from), at(outer, to), at(inner, to), at(inner, from)];
  return `M${a}A${outer} ${outer} 0 0 1 ${b}L${c}A${inner} ${inner} 0 0 0 ${d}Z`;
}

/**
 * @param {number} degrees
 * @param {number} limit
 */
function limitMark(degrees, limit) {
  const [x, y] = polar(226, degrees);
  const isLeft = degrees < 90;
  const isTop = Math.abs(degrees - 90) < 26; // above the band there is no room: the label is beside the wedge
  return {
    line: ray(degrees, 170, 191),
    wedge: `M${at(191, degrees)}L${at(205, degrees - 4)}L${at(205, degrees + 4)}Z`,
    text: fixed(limit),
    x: isTop ? polar(205, degrees)[0] + 20 : isLeft ? clamp(x - 37, 2, 378) : clamp(x + 37, 2, 378),
    y: isTop ? 18 : clamp(y + 1, 14, 60),
    anchor: /** @type {'start' | 'end'} */ (isTop || isLeft ? 'start' : 'end'),
  };
}

/** Every 6° beyond the limit. @param {number} limit */
function rungs(limit) {
  const found = [];
  for (let degrees = limit + 6; degrees < 179; degrees += 6) found.push(ray(degrees, 174, 186));
  return found;
}

/**
 * @param {number} degrees
 * @param {number} value
 */
function numberAt(degrees, value) {
  const text = plain(value);
  if (degrees === 0) return { degrees, text, x: 55, y: 214 };
  if (degrees === 180) return { degrees, text, x: 325, y: 214 };
  const [x, y] = polar(141, degrees);
  return { degrees, text, x, y: y + 6 };
}

/** Would it stand on an end of the inner arc? @param {Label} label */
function isInTheWay({ x, y }) {
  return [57, 323].some((end) => Math.abs(x - end) < 27 && Math.abs(y - 188) < 17);
}

/** Ticks each 1 m/s about 15; elsewhere so that there are at most 20. @param {number} max */
function tickStep(max) {
  return [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20].find((step) => max / step <= 20) ?? max / 10;
}

/** @param {number} value */
function plain(value) {
  const parts = Math.abs(value) < 10 ? 100 : 10;
  return String(Math.round(value * parts) / parts);
}

/**
 * @param {number} degrees
 * @param {number} from
 * @param {number} to
 */
function ray(degrees, from, to) {
  return `M${at(from, degrees)}L${at(to, degrees)}`;
}

/**
 * @param {number} radius
 * @param {number} from
 * @param {number} to
 */
function arc(radius, from, to) {
  return `M${at(radius, from)}A${radius} ${radius} 0 0 1 ${at(radius, to)}`;
}

/**
 * @param {number} radius
 * @param {number} degrees
 */
function at(radius, degrees) {
  return polar(radius, degrees).map((part) => part.toFixed(1)).join(' ');
}

/**
 * @param {number} radius
 * @param {number} degrees 0 left, 90 up, 180 right
 * @returns {[number, number]}
 */
function polar(radius, degrees) {
  const angle = (degrees * Math.PI) / 180;
  return [CENTRE.x - radius * Math.cos(angle), CENTRE.y - radius * Math.sin(angle)];
}

/**
 * @param {number} value
 * @param {number} low
 * @param {number} high
 */
function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}
