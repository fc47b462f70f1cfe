// What the plots of the report show and where: pure functions, and the types of its data.

/**
 * @typedef {{label: string, ink: 'ink' | 'ink2' | 'order' | 'you', limit: boolean, t: number[], v: (number | null)[]}} Curve
 * @typedef {{title: string, unit: string, digits: number, curves: Curve[]}} Panel
 * @typedef {{alarm: string, title: string, priority: string, from: number, to: number, open: boolean,
 *   hidden: [number, number][]}} Bar
 * @typedef {{label: string, priority: string, spans: [number, number, string, string][]}} CheckTimeline
 * @typedef {{from: number, to: number, startMs: number | null, panels: Panel[], track: {t: number[], e: number[],
 *   n: number[]} | null, episodes: Bar[], before: Bar[], timelines: CheckTimeline[], injected: [string, number, number][]}} Data
 */

const LEAST_S = 2; // no zoom shows less

/** Returns the index of the last time at or before `at`, −1 before the first. */
export function indexAt(/** @type {number[]} */ times, /** @type {number} */ at) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= at) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Returns the view from `from` to `to`, moved and stretched so that it is within the drive. */
export function within(/** @type {number} */ from, /** @type {number} */ to, /** @type {number} */ first, /** @type {number} */ last) {
  const whole = last - first;
  const span = Math.min(Math.max(to - from, Math.min(LEAST_S, whole)), whole);
  const middle = (from + to) / 2;
  const start = Math.min(Math.max(middle - span / 2, first), last - span);
  return { from: start, to: start + span };
}

/** Formats a time of the drive: 12.3 s, from ten minutes on 12:34.5. */
export function clock(/** @type {number} */ seconds) {
  if (Math.abs(seconds) < 600) return `${seconds.toFixed(1)} s`;
  const tenths = Math.round(seconds * 10);
  const minutes = Math.floor(tenths / 600);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, '0');
  return minutes < 60 ? `${minutes}:${rest}` : `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, '0')}:${rest}`;
}

/** Groups the bars by alarm: one lane each. */
export function lanesOf(/** @type {Bar[]} */ bars) {
  /** @type {Map<string, {title: string, priority: string, bars: {bar: Bar, index: number}[]}>} */
  const lanes = new Map();
  bars.forEach((bar, index) => {
    const lane = lanes.get(bar.alarm) ?? { title: bar.title, priority: bar.priority, bars: [] };
    lane.bars.push({ bar, index });
    lanes.set(bar.alarm, lane);
  });
  return [...lanes.values()];
}

/** Joins the curves of a panel to one table; undefined: this curve has no point there, null: it has a gap. */
export function joined(/** @type {Curve[]} */ curves) {
  const times = [...new Set(curves.flatMap((curve) => curve.t))].sort((a, b) => a - b);
  const place = new Map(times.map((time, index) => [time, index]));
  const columns = curves.map((curve) => {
    /** @type {(number | null | undefined)[]} */
    const column = new Array(times.length).fill(undefined);
    curve.t.forEach((time, index) => { column[/** @type {number} */ (place.get(time))] = curve.v[index]; });
    if (!curve.limit) return column;
    /** @type {number | null} */
    let held = null; // a limit has a point where it changes, and holds between
    return column.map((value) => (held = value === undefined ? held : value));
  });
  return [times, ...columns];
}

/** Returns a round length of about a fifth of `metres`. */
export function roundStep(/** @type {number} */ metres) {
  const rough = metres / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough) ?? rough;
}
