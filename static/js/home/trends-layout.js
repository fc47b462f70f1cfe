// The last minute of a signal as columns, and what of it is line, gap and scale: pure functions, no DOM.

/** Steps kept: a minute. As the server has it. */
export const SPAN = 300;
export const STEP_S = 0.2;
/** Nothing for longer than so many periods of the signal is a gap; but a step or two without a message are the radio's rhythm. */
const GAP_PERIODS = 3;
const GAP_LEAST_S = 0.5;

/**
 * @typedef {import('../core/protocol-types.js').Trends} Frame
 *
 * @typedef {object} Spec
 * @property {string} name
 * @property {string} label short, for the small picture
 * @property {string} title
 * @property {string} unit of the wire
 * @property {number} digits
 * @property {boolean} isSigned shown with its sign
 * @property {string | null} limit its name in the frame
 * @property {(limits: Record<string, number>, low: number, high: number) => [number, number]} ends of the scale, in the wire's unit
 */

/** Their places are fixed; what else the server keeps follows them. @type {Spec[]} */
export const SPECS = [
  { name: 'speed', label: 'Speed', title: 'Speed', unit: 'm/s', digits: 1, isSigned: false, limit: 'speed_limit.max_mps',
    ends: (limits, low, high) => [low < 0 ? -upTo(-low, [1, 2, 5, 15, 60]) : 0, Math.max(limits['gauge.speed_max_mps'] ?? 15, high, limits['speed_limit.max_mps'] ?? 0)] },
  { name: 'acceleration', label: 'Acceleration', title: 'Acceleration', unit: 'm/s²', digits: 1, isSigned: true, limit: null,
    ends: (limits, low, high) => both(Math.max(limits['gauge.acceleration_max_mps2'] ?? 3, -low, high)) },
  { name: 'distance', label: 'Nearest', title: 'Nearest object ahead', unit: 'm', digits: 1, isSigned: false, limit: 'obstacle.standoff_m',
    ends: (limits, _, high) => [0, upTo(Math.max(high, 1.2 * (limits['obstacle.standoff_m'] ?? 0)), [20, 40, 80, 200])] },
  { name: 'steering', label: 'Steering', title: 'Steering, negative is left', unit: '%', digits: 0, isSigned: true, limit: null,
    ends: (_, low, high) => both(upTo(Math.max(-low, high), [20, 50, 100])) },
  { name: 'brake', label: 'Brake', title: 'Brake', unit: '%', digits: 0, isSigned: false, limit: null, ends: (_, low, high) => [Math.min(0, low), Math.max(100, high)] },
  { name: 'accelerator', label: 'Accelerator', title: 'Accelerator', unit: '%', digits: 0, isSigned: false, limit: null, ends: (_, low, high) => [Math.min(0, low), Math.max(100, high)] },
];

/**
 * How a signal is drawn that has no place of its own above.
 * @param {string} name
 * @param {{label: string, unit?: string}} signal
 * @returns {Spec}
 */
export function specOf(name, { label, unit = '' }) {
  const round = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
  return { name, label, title: label, unit, digits: 1, isSigned: false, limit: null,
    ends: (_, low, high) => [low < 0 ? -upTo(-low, round) : 0, upTo(Math.max(0, high), round)] };
}

/** @param {number} end @returns {[number, number]} */
function both(end) {
  return [-end, end];
}

/** The first round end that holds `wanted`. @param {number} wanted @param {number[]} ends */
function upTo(wanted, ends) {
  return ends.find((end) => end >= wanted) ?? wanted;
}

/** In the place of a number: messages came and had none to give. */
const NO_NUMBER = Infinity;

/**
 * The last minute of all signals, in rings that never grow. A step that was not received holds NaN.
 */
export class Minute {
  /** The newest step received, or −1. */
  last = -1;
  /** The first step since the car was dialled. */
  since = 0;
  /** First step after which some were missed and are not requested yet; null: none. @type {number | null} */
  missed = null;
  /** The newest frame's moment, as a step and its part. */
  now = 0;
  /** @type {Record<string, {lowest: Float64Array, highest: Float64Array}>} */
  #rings = {};

  /** Forget everything: another run of the server counts anew. */
  clear() {
    this.last = -1;
    this.missed = null;
    this.now = 0;
    for (const { lowest, highest } of Object.values(this.#rings)) {
      lowest.fill(NaN);
      highest.fill(NaN);
    }
  }

  /**
   * Takes the steps that the server sent, in a state or on demand.
   * @param {Frame} frame
   * @param {boolean} [isAnswer] to a request: what it lacks is not available
   */
  take(frame, isAnswer = false) {
    if (frame.since > this.since && this.last >= 0) this.clear(); // another car was dialled
    this.since = frame.since;
    this.now = Math.max(this.now, frame.now);
    const count = Math.max(0, ...Object.values(frame.lowest).map((steps) => steps.length));
    const end = frame.first + count - 1;
    if (isAnswer) this.missed = null;
    else if (frame.first > this.last + 1) {
      const from = Math.max(this.last, this.since - 1);
      if (frame.first > from + 1) this.missed = Math.min(this.missed ?? Infinity, from);
    }
    for (const name of Object.keys(frame.lowest)) this.#rings[name] ??= { lowest: new Float64Array(SPAN).fill(NaN), highest: new Float64Array(SPAN).fill(NaN) };
    this.#open(end);
    for (const [name, ring] of Object.entries(this.#rings)) {
      for (let i = 0; i < count; i += 1) {
        const step = frame.first + i;
        if (step <= this.last - SPAN) continue;
        ring.lowest[step % SPAN] = numberOf(frame.lowest[name]?.[i]);
        ring.highest[step % SPAN] = numberOf(frame.highest[name]?.[i]);
      }
    }
  }

  /** The steps between the newest one and this one are unknown until they are received. @param {number} end */
  #open(end) {
    if (end <= this.last) return;
    const from = Math.max(this.last + 1, end - SPAN + 1);
    for (const ring of Object.values(this.#rings)) {
      for (let step = from; step <= end; step += 1) ring.lowest[step % SPAN] = ring.highest[step % SPAN] = NaN;
    }
    this.last = end;
  }

  /**
   * One signal's minute up to a moment, cut into lines and gaps. Times are seconds before that moment, ≤ 0.
   * @param {string} name
   * @param {number} now as a step and its part
   * @param {number | null} period_s of the signal
   * @returns {Course}
   */
  course(name, now, period_s) {
    const ring = this.#rings[name];
    const first = Math.max(0, Math.ceil(now) - SPAN);
    const gap_steps = Math.max(GAP_LEAST_S, GAP_PERIODS * (period_s ?? 0)) / STEP_S;
    /** @type {Course} */
    const course = { times_s: [], lowest: [], highest: [], gaps: [], low: NaN, high: NaN, isEmpty: true };
    if (!ring) return course;
    let received = now - SPAN; // up to where data was received
    for (let step = first; step <= this.last && step < now; step += 1) {
      const low = ring.lowest[step % SPAN] ?? NaN;
      if (Number.isNaN(low) || step <= this.last - SPAN) continue;
      const at_s = Math.min(0, (step + 0.5 - now) * STEP_S);
      if (step - received > gap_steps) course.gaps.push([Math.max(-SPAN * STEP_S, (received - now) * STEP_S), (step - now) * STEP_S]);
      if (step - received > gap_steps || low === NO_NUMBER) cut(course);
      if (low !== NO_NUMBER) {
        const high = ring.highest[step % SPAN] ?? low;
        course.times_s.push(at_s);
        course.lowest.push(low);
        course.highest.push(high);
        course.low = course.isEmpty ? low : Math.min(course.low, low);
        course.high = course.isEmpty ? high : Math.max(course.high, high);
        course.isEmpty = false;
      }
      received = step + 1;
    }
    // The step under way is not received yet: the frame with it has a delay.
    if (now - received > gap_steps + 2) course.gaps.push([Math.max(-SPAN * STEP_S, (received - now) * STEP_S), 0]);
    return course;
  }
}

/**
 * @typedef {object} Course
 * @property {number[]} times_s before now, ascending; one after the other where a line is cut
 * @property {(number | null)[]} lowest null: the line is cut here
 * @property {(number | null)[]} highest
 * @property {[number, number][]} gaps from and to [s before now]: nobody knows
 * @property {number} low of the whole
 * @property {number} high
 * @property {boolean} isEmpty no number at all
 */

/** The line ends here. @param {Course} course */
function cut(course) {
  const last_s = course.times_s.at(-1);
  if (last_s === undefined || course.lowest.at(-1) === null) return;
  course.times_s.push(last_s + STEP_S / 4);
  course.lowest.push(null);
  course.highest.push(null);
}

/** @param {import('../core/protocol-types.js').Step | undefined} step */
function numberOf(step) {
  return typeof step === 'number' ? step : step === 'none' ? NO_NUMBER : NaN;
}
