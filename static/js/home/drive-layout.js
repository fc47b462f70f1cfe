// The chart of a drive: what is in view, how its lines are cut, what stands at the cursor. Pure functions, no DOM.

import { fixed, signed, timeOfDay } from '../core/format.js';
import { RANK } from '../core/priority.js';
import { shownIn } from '../core/units.js';
import { SPECS, specOf } from './trends-layout.js';

/** The shortest time that fills a chart [s]. */
export const LEAST_S = 10;
/** Marks that would stand closer are one [px]. */
const MARK_PX = 16;

/**
 * @typedef {import('../core/protocol-types.js').DriveTrendsAnswer} Answer
 * @typedef {import('../core/protocol-types.js').DriveTrend} Trend
 * @typedef {import('../core/protocol-types.js').TrendMark} Mark
 * @typedef {import('./trends-layout.js').Spec} Spec
 * @typedef {[number, number]} View from and to, seconds since the drive began
 * @typedef {{from_s: number, step_s: number}} Buckets
 * @typedef {{kind: 'value', low: number, high: number} | {kind: 'gap' | 'none' | 'unknown'}} Found
 */

/**
 * How a signal is drawn: those of Home as there, others between round ends about their numbers.
 * @param {string} name
 * @param {{label: string, unit: string} | undefined} offer
 * @returns {Spec}
 */
export function specFor(name, offer) {
  const known = SPECS.find((spec) => spec.name === name);
  if (known) return known;
  const spec = specOf(name, offer ?? { label: name });
  return { ...spec, digits: spec.unit === 'rad' ? 2 : 1, ends: (_, low, high) => roundEnds(low, high) };
}

/** Round ends that hold two numbers, at least one apart. @param {number} low @param {number} high @returns {[number, number]} */
export function roundEnds(low, high) {
  const step = 10 ** Math.floor(Math.log10(Math.max(1, high - low)));
  const [from, to] = [Math.floor(low / step) * step, Math.ceil(high / step) * step];
  return to > from ? [from, to] : [from, from + step];
}

/**
 * The view after a step of zoom or pan. It stays within the drive, or within its own width where the drive is shorter.
 * @param {View} view
 * @param {{zoom?: number, pan?: number, about?: number}} change zoom: new width by old; pan: by the width; about: what stays in place, 0 … 1
 * @param {number} end_s of the drive
 * @returns {View}
 */
export function viewAfter([from_s, to_s], { zoom = 1, pan = 0, about = 0.5 }, end_s) {
  const width_s = Math.max(LEAST_S, Math.min(Math.max(end_s, LEAST_S), (to_s - from_s) * zoom));
  const still_s = from_s + (to_s - from_s) * about;
  return within([still_s - width_s * about + width_s * pan, still_s + width_s * (1 - about) + width_s * pan], end_s);
}

/** A view moved into the drive. @param {View} view @param {number} end_s @returns {View} */
export function within([from_s, to_s], end_s) {
  const width_s = to_s - from_s;
  const begin_s = Math.min(Math.max(from_s, 0), end_s - width_s); // a short drive ends at the right edge
  return [begin_s, begin_s + width_s];
}

/**
 * A signal as a line of lowest and highest, cut wherever a gap or a time without a number lies between two buckets.
 * @param {Trend} trend
 * @param {Buckets} buckets
 * @returns {{times_s: number[], lowest: (number | null)[], highest: (number | null)[]}} null: the line ends
 */
export function lineOf(trend, { from_s, step_s }) {
  const cuts = [...trend.gaps, ...trend.none].sort((a, b) => a[0] - b[0]);
  /** @type {ReturnType<typeof lineOf>} */
  const line = { times_s: [], lowest: [], highest: [] };
  let next = 0;
  let last_s = -Infinity;
  trend.lowest.forEach((low, i) => {
    const high = trend.highest[i] ?? null;
    if (low === null || high === null) return;
    const at_s = from_s + (i + 0.5) * step_s;
    while (next < cuts.length && (cuts[next]?.[1] ?? 0) <= last_s - step_s / 2) next += 1;
    const cut = cuts[next];
    if (line.times_s.length && cut && cut[0] < at_s && cut[1] > last_s) {
      line.times_s.push((last_s + at_s) / 2);
      line.lowest.push(null);
      line.highest.push(null);
    }
    line.times_s.push(at_s);
    line.lowest.push(low);
    line.highest.push(high);
    last_s = at_s;
  });
  return line;
}

/** Lowest and highest of what is in view; null: no number. @param {Trend} trend @param {Buckets} buckets @param {View} view @returns {[number, number] | null} */
export function extentOf(trend, { from_s, step_s }, [begin_s, end_s]) {
  let [low, high] = [Infinity, -Infinity];
  for (let i = Math.max(0, Math.floor((begin_s - from_s) / step_s)); i < trend.lowest.length && from_s + i * step_s <= end_s; i += 1) {
    low = Math.min(low, trend.lowest[i] ?? Infinity);
    high = Math.max(high, trend.highest[i] ?? -Infinity);
  }
  return low <= high ? [low, high] : null;
}

/**
 * What a signal was at a moment. Between two of its messages it is that of the nearest bucket, never across a gap.
 * @param {Trend} trend
 * @param {Buckets} buckets
 * @param {number} at_s
 * @returns {Found}
 */
export function foundAt(trend, { from_s, step_s }, at_s) {
  const inside = (/** @type {[number, number]} */ [a, b]) => at_s >= a && at_s <= b;
  if (trend.gaps.some(inside)) return { kind: 'gap' };
  const index = Math.floor((at_s - from_s) / step_s);
  for (const far of [0, -1, 1, -2, 2, -3, 3, -4, 4]) {
    const [low, high] = [trend.lowest[index + far], trend.highest[index + far]];
    if (typeof low !== 'number' || typeof high !== 'number') continue;
    const [a, b] = [Math.min(at_s, from_s + (index + far) * step_s), Math.max(at_s, from_s + (index + far + 1) * step_s)];
    if (far !== 0 && [...trend.gaps, ...trend.none].some(([c, d]) => c < b && d > a)) continue;
    return { kind: 'value', low, high };
  }
  return { kind: trend.none.some(inside) ? 'none' : 'unknown' };
}

/** The found value as text: a number, or two where the bucket has both. @param {Found} found @param {Spec} spec */
export function foundWords(found, spec) {
  if (found.kind !== 'value') return { gap: 'no data', none: spec.name === 'distance' ? 'none in range' : 'no number', unknown: '–' }[found.kind];
  const [low, high] = [found.low, found.high].map((value) => (spec.isSigned ? signed : fixed)(shownIn(value, spec.unit).value, spec.digits));
  return low === high ? `${low}` : `${low} to ${high}`;
}

/** The limit that stood at a moment; null: none. @param {[number, number][]} limits @param {number} at_s */
export function limitAt(limits, at_s) {
  return limits.findLast(([from_s]) => from_s <= at_s)?.[1] ?? null;
}

/**
 * The marks in view; those that would cover each other are one, with the most urgent's shape and place. Advisories have none.
 * @param {Mark[]} marks in the order of time
 * @param {View} view
 * @param {number} width [px]
 */
export function placedMarks(marks, [from_s, to_s], width) {
  /** @type {{x: number, at_s: number, count: number, title: string, priority: 'critical' | 'warning'}[]} */
  const found = [];
  for (const { at_s, priority, title } of marks) {
    if (priority === 'advisory' || at_s < from_s || at_s > to_s) continue;
    const x = ((at_s - from_s) / (to_s - from_s)) * width;
    const last = found.at(-1);
    if (!last || x - last.x >= MARK_PX) found.push({ x, at_s, count: 1, title, priority });
    else {
      last.count += 1;
      if (RANK[priority] > RANK[last.priority]) Object.assign(last, { x, at_s, title, priority });
    }
  }
  return found;
}

/** The tag of the cursor stands no farther beside it [px]. */
const BESIDE_PX = 24;

/**
 * Where the tag of the cursor begins: above the cursor, or the nearest place beside it where it covers fewer marks of alarms, a critical one last.
 * @param {number} x of the cursor
 * @param {number[]} marks their middles
 * @param {{left: number, right: number, width: number, mark: number}} sizes the ends of the chart, widths of tag and mark
 * @param {number[]} [critical] those of the marks that are critical
 */
export function tagAt(x, marks, { left, right, width, mark }, critical = []) {
  const inside = (/** @type {number} */ at) => Math.max(left, Math.min(right - width, at));
  const under = (/** @type {number[]} */ some, /** @type {number} */ at) => some.filter((one) => one + mark / 2 > at && one - mark / 2 < at + width).length;
  const covers = (/** @type {number} */ at) => under(critical, at) * (marks.length + 1) + under(marks, at);
  const far = (/** @type {number} */ at) => Math.abs(at + width / 2 - x);
  const places = [x - width / 2, ...[x, ...marks].flatMap((one) => [one + mark / 2, one - mark / 2 - width])].map(inside);
  return places.filter((at) => Math.max(at - x, x - at - width) <= BESIDE_PX).reduce((best, at) => (covers(at) - covers(best) || far(at) - far(best)) < 0 ? at : best);
}

/** A tick of the clock axis: with seconds where ticks are less than a minute apart. @param {number} at_s since 1970 @param {number} apart_s */
export function clockWords(at_s, apart_s) {
  const clock = timeOfDay(at_s * 1000);
  return apart_s < 60 ? clock : clock.slice(0, 5);
}

/** Half of the width of a digit of the axes [px]. */
const HALF_DIGIT_PX = 4;

/** A label in the middle under its tick; none where the right edge of the drawing would cut it. @param {string} text @param {number} x_px of the tick @param {number} right_px */
export function wholeLabel(text, x_px, right_px) {
  return x_px + HALF_DIGIT_PX * text.length > right_px ? '' : text;
}

/**
 * The ticks of a value axis: multiples of a round step, or in a low pane its ends.
 * @param {number} low @param {number} high
 * @param {number} apart
 * @param {boolean} isLow
 */
export function valueTicks(low, high, apart, isLow) {
  if (isLow || !(apart > 0)) return [low, high];
  const first = Math.ceil(low / apart - 1e-6);
  return Array.from({ length: Math.max(0, Math.floor(high / apart + 1e-6) - first + 1) }, (_, i) => (first + i) * apart);
}

/**
 * A line as an SVG path through the middle of its buckets, for the brush.
 * @param {Trend} trend
 * @param {Buckets} buckets
 * @param {number} length_s
 * @param {number} width @param {number} top @param {number} base [px]
 */
export function brushPath(trend, buckets, length_s, width, top, base) {
  const line = lineOf(trend, buckets);
  const numbers = [...line.lowest, ...line.highest].filter((value) => value !== null);
  const [low, high] = [Math.min(0, ...numbers), Math.max(1e-6, ...numbers)];
  let path = '';
  let isCut = true;
  line.times_s.forEach((at_s, i) => {
    const [a, b] = [line.lowest[i] ?? null, line.highest[i] ?? null];
    if (a === null || b === null) {
      isCut = true;
      return;
    }
    const x = (Math.min(at_s, length_s) / length_s) * width;
    const y = base - (((a + b) / 2 - low) / (high - low)) * (base - top);
    path += `${isCut ? 'M' : 'L'}${x.toFixed(1)} ${y.toFixed(1)}`;
    isCut = false;
  });
  return path;
}

/**
 * What is in view as a table: one line a bucket, an empty field where there is no number.
 * @param {Answer} answer
 * @param {Spec[]} specs
 * @param {View} view
 */
export function csvOf(answer, specs, [begin_s, end_s]) {
  const head = ['time_utc', 'seconds', ...specs.flatMap(({ title, unit }) => ['lowest', 'highest'].map((end) => quoted(`${title} ${end}${unit ? ` [${shownIn(0, unit).unit}]` : ''}`)))];
  const lines = [head.join(',')];
  const count = Math.max(0, ...specs.map(({ name }) => answer.signals[name]?.lowest.length ?? 0));
  for (let i = 0; i < count; i += 1) {
    const at_s = answer.from_s + i * answer.step_s;
    if (at_s + answer.step_s <= begin_s || at_s >= end_s) continue;
    const fields = specs.flatMap(({ name, unit }) => [answer.signals[name]?.lowest[i], answer.signals[name]?.highest[i]].map((value) => (typeof value === 'number' ? String(Number(shownIn(value, unit).value.toPrecision(6))) : '')));
    lines.push([new Date(answer.start_ms + at_s * 1000).toISOString(), at_s.toFixed(2), ...fields].join(','));
  }
  return `${lines.join('\r\n')}\r\n`;
}

/** @param {string} text */
function quoted(text) {
  return /[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
