// The positions on the time line of a replay, and its texts: pure functions, no DOM.

import { byUrgency, titleOf } from '../alarms/alarm-layout.js';
import { local } from '../core/decimal.js';
import { counted, duration, fixed } from '../core/format.js';
import { RANK } from '../core/priority.js';

export const RATES = /** @type {const} */ ([0.25, 0.5, 1, 2, 4, 8, 16]);
/** The picture is so high [px]: marks above, the speed, its base, the foot of the thumb. */
export const HEIGHT = 72;
const TOP = 27;
export const BASE = 60;
/** Marks that would stand closer are one [px]. */
const MARK_PX = 16;
/** So long without a speed breaks its line [s]. */
const BREAK_S = 3;
/** The alarm before this one, not this one again [s]. */
const BEHIND_S = 1;

/**
 * @typedef {import('../core/protocol-types.js').Timeline} Timeline
 * @typedef {import('../core/protocol-types.js').Mark} Mark
 * @typedef {{x: number, count: number, priority: import('../core/protocol-types.js').Priority, title: string, at_s: number}} Placed
 */


/** @param {number} at_s @param {number} length_s @param {number} width */
export function xOf(at_s, length_s, width) {
  return length_s > 0 ? (Math.min(Math.max(at_s, 0), length_s) / length_s) * width : 0;
}

/** The moment under a finger, always within the recording. @param {number} x @param {number} length_s @param {number} width */
export function atOf(x, length_s, width) {
  return width > 0 && Number.isFinite(x) ? Math.min(Math.max(x / width, 0), 1) * length_s : 0;
}

/**
 * The speed as an SVG path; where none was recorded there is no line.
 * @param {Pick<Timeline, 'speed_mps' | 'bucket_s' | 'length_s'>} line
 * @param {number} width
 */
export function speedPath({ speed_mps, bucket_s, length_s }, width) {
  const top = Math.max(1, ...speed_mps.map((speed) => speed ?? 0));
  const least = Math.max(2, Math.ceil(BREAK_S / bucket_s));
  let path = '';
  let last = -Infinity;
  speed_mps.forEach((speed, i) => {
    if (speed === null) return;
    const x = xOf((i + 0.5) * bucket_s, length_s, width);
    const y = BASE - (speed / top) * (BASE - TOP);
    path += `${i - last > least ? 'M' : 'L'}${x.toFixed(1)} ${y.toFixed(1)}`;
    last = i;
  });
  return path;
}

/**
 * Where nothing was recorded: from and width; at least as wide as can be seen.
 * @param {Pick<Timeline, 'gaps' | 'length_s'>} line
 * @param {number} width
 * @returns {[number, number][]}
 */
export function gapBands({ gaps, length_s }, width) {
  return gaps.map(([from_s, to_s]) => {
    const x = xOf(from_s, length_s, width);
    return [x, Math.max(2, xOf(to_s, length_s, width) - x)];
  });
}

/**
 * Alarms as marks: those that would cover each other are one, with the shape of the most urgent.
 * @param {Mark[]} marks in the order of time
 * @param {number} length_s
 * @param {number} width
 * @returns {Placed[]}
 */
export function placed(marks, length_s, width) {
  /** @type {Placed[]} */
  const found = [];
  for (const mark of marks) {
    if (mark.priority === 'advisory') continue; // no mark in the design: listed, and reached by the keys
    const x = xOf(mark.at_s, length_s, width);
    const last = found.at(-1);
    if (!last || x - last.x >= MARK_PX) {
      found.push({ x, count: 1, priority: mark.priority, title: mark.title, at_s: mark.at_s });
      continue;
    }
    last.count += 1;
    if (RANK[mark.priority] > RANK[last.priority]) Object.assign(last, { priority: mark.priority, title: mark.title, at_s: mark.at_s });
  }
  return found;
}

/**
 * A mark's outline about (x, 13): a diamond for what is critical, a triangle for a warning.
 * @param {Placed} mark
 */
export function markPath({ x, priority }) {
  const at = x.toFixed(1);
  return priority === 'critical' ? `M${at} 4l8 8.5-8 8.5-8-8.5z` : `M${at} 4.5l9 16h-18z`;
}

/** A flag beneath the base at (x): what a person marked. @param {number} x */
export function flagPath(x) {
  return `M${x.toFixed(1)} ${HEIGHT}V${BASE + 1}h10l-2.6 3.2 2.6 3.2h-8.4`;
}

/**
 * Where a person drives: x and width of each.
 * @param {Pick<Timeline, 'modes' | 'length_s'>} line
 * @param {number} width
 * @returns {[number, number][]}
 */
export function manualBands({ modes, length_s }, width) {
  return modes.filter(({ mode }) => mode === 'manual').map(({ from_s, to_s }) => {
    const x = xOf(from_s, length_s, width);
    return [x, Math.max(1, xOf(to_s, length_s, width) - x)];
  });
}

/** Alarms and marks in the order of time. @param {{at_s: number}[]} alarms @param {{at_s: number}[]} flags */
export function eventsOf(alarms, flags) {
  return flags.length ? [...alarms, ...flags].sort((a, b) => a.at_s - b.at_s) : alarms;
}

/**
 * The alarm or mark before or after a moment.
 * @template {{at_s: number}} One
 * @param {One[]} marks
 * @param {number} at_s
 * @param {1 | -1} direction
 * @returns {One | null}
 */
export function markBeside(marks, at_s, direction) {
  const ahead = marks.filter((mark) => (direction > 0 ? mark.at_s > at_s + 0.05 : mark.at_s < at_s - BEHIND_S));
  return (direction > 0 ? ahead[0] : ahead.at(-1)) ?? null;
}

/**
 * Where a key on the time line leads; null: nowhere.
 * @param {string} key
 * @param {number} at_s
 * @param {number} length_s
 */
export function atByKey(key, at_s, length_s) {
  const step_s = Math.max(1, Math.min(5, length_s / 20));
  const leaps = /** @type {Record<string, number>} */ ({
    ArrowRight: step_s, ArrowUp: step_s, ArrowLeft: -step_s, ArrowDown: -step_s, PageUp: 6 * step_s, PageDown: -6 * step_s,
    Home: -Infinity, End: Infinity,
  });
  const leap = leaps[key];
  return leap === undefined ? null : Math.min(Math.max(at_s + leap, 0), length_s);
}

/** "04:06", from an hour on "1:04:06". @param {number} at_s */
export function clockOf(at_s) {
  return duration(at_s, true);
}

/** Where the tape is, "04:06 of 17:51": a length alone would read as a time of day. @param {{at_s: number, length_s: number}} replay */
export function tapeWords({ at_s, length_s }) {
  return `${clockOf(at_s)} of ${clockOf(length_s)}`;
}

/**
 * The text of the thumb for a screen reader: "4 minutes 6 seconds of 8 minutes 32 seconds".
 * @param {number} at_s
 * @param {number} length_s
 */
export function spoken(at_s, length_s) {
  return `${long(at_s)} of ${long(length_s)}`;
}

/** @param {number} seconds */
function long(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const parts = [hours && counted(hours, 'hour'), minutes && counted(minutes, 'minute'), (rest || whole < 60) && counted(rest, 'second')];
  return parts.filter(Boolean).join(' ');
}

/** "×0.25", "×16". @param {number} rate */
export function rateWords(rate) {
  return `×${rate >= 10 || Number.isInteger(rate) ? Math.round(rate) : local(String(Number(rate.toFixed(2))))}`;
}

/** "19 Nov 2026", by this phone's own calendar. @param {number} at_ms */
export function dateOf(at_ms) {
  if (!Number.isFinite(at_ms)) return '–';
  return new Intl.DateTimeFormat('en-GB', { day: 'numeric', month: 'short', year: 'numeric' }).format(new Date(at_ms));
}

/**
 * @typedef {object} Moment the line of the band
 * @property {'crit' | 'warn' | 'gap' | ''} kind
 * @property {string} icon
 * @property {string} text
 * @property {string} end
 */

/**
 * The text of the moment that is shown: first what is wrong with the replay itself, then what was not recorded, then
 * the alarms.
 * @param {import('../core/protocol-types.js').State} frame a replay's
 * @returns {Moment}
 */
export function momentOf(frame) {
  const { replay, alarms } = frame;
  if (!replay) return { kind: '', icon: 'unknown', text: '', end: '' };
  const end = replay.alarms_from === 'recording' ? 'original alarms' : 're-evaluated';
  if (replay.hangs_s) return { kind: 'gap', icon: 'clock', text: `The replay has not answered for ${replay.hangs_s.toFixed(0)} s`, end: '' };
  if (replay.is_seeking) return { kind: '', icon: 'clock', text: `Seeking to ${clockOf(replay.at_s)}`, end: '' };
  if (replay.silent_s === null) return { kind: 'gap', icon: 'unknown', text: 'No message from the car yet', end: '' };
  if (replay.silent_s > 1) return { kind: 'gap', icon: 'unknown', text: `Nothing recorded for ${fixed(replay.silent_s)} s`, end: '' };
  const standing = alarms.filter((alarm) => alarm.active && alarm.state !== 'SHELVED').sort((a, b) => RANK[b.priority] - RANK[a.priority] || b.raised_ms - a.raised_ms);
  const worst = standing[0];
  const among = standing.length > 1 ? `${counted(standing.length, 'alarm', 'alarms')}, ${end === 're-evaluated' ? end : 'original'}` : end;
  if (worst) {
    const kind = worst.priority === 'critical' ? 'crit' : worst.priority === 'warning' ? 'warn' : '';
    return { kind, icon: kind || 'info', text: worst.title, end: among };
  }
  if (frame.session.paused) return { kind: 'gap', icon: 'pause', text: 'Monitoring was paused', end: '' };
  if (!replay.is_settled) return { kind: '', icon: 'clock', text: 'Checks still warming up', end };
  return { kind: '', icon: 'ok', text: 'No alarms', end };
}

/**
 * The time line as far as the catalog knows it; null: it knows no length.
 * @param {import('../core/protocol-types.js').Recording} row that was requested alone
 * @returns {Timeline | null}
 */
export function sketchOf({ length_s, speed_mps = [], raised = [], started_ms }) {
  if (length_s === null || !(length_s > 0)) return null;
  const marks = raised.map(({ at_ms, alarm, title, priority, text }) => ({ at_s: Math.max(0, (at_ms - started_ms) / 1000), alarm, title, priority, text, duration_s: null }));
  return { kind: 'timeline', length_s, done_s: 0, is_done: false, bucket_s: length_s / Math.max(1, speed_mps.length), speed_mps, gaps: [], marks, marks_left_out: 0, flags: [], interventions: [], modes: [], notes: [] };
}

/** How many alarms the recording has, as far as it was read. @param {Pick<Timeline, 'marks' | 'marks_left_out' | 'is_done'> | null} line */
export function countWords(line) {
  if (!line) return 'Alarms';
  const count = line.marks.length + line.marks_left_out;
  if (line.is_done) return counted(count, 'alarm');
  return count ? `${counted(count, 'alarm')}, still reading` : 'Alarms';
}

/**
 * The parts of a live frame for `asideOf` and `liveWords`, as a replay's frame has it.
 * @param {import('../core/protocol-types.js').State} frame
 * @returns {import('../core/protocol-types.js').LiveSummary}
 */
export function summaryOf({ session, link, recording, control, reach, decelerate, alarms }) {
  return { phase: session.phase, name: session.name, paused: session.paused, cut: link.cut, problem: link.problem?.title ?? null, recording, control, reach, decelerate, alarms, alarms_in_all: alarms.length };
}

/**
 * The live car in one line: alarms that need no operator, and the recording.
 * @param {import('../core/protocol-types.js').LiveSummary | null | undefined} live
 * @returns {{text: string, recording: string}}
 */
export function liveWords(live) {
  if (!live) return { text: 'alarms unknown', recording: 'recording unknown' };
  const { state, for_s, reason } = live.recording;
  const recording = state === 'recording' ? `recording ${duration(for_s ?? 0, true)}` : state === 'off' ? 'not recording' : state === 'stopped' ? `recording stopped${reason ? `: ${reason}` : ''}` : `recording ${state}`;
  if (live.phase !== 'monitoring') return { text: 'no car is monitored', recording };
  if (live.alarms_in_all === 0) return { text: 'no alarms', recording };
  return { text: `no urgent alarm, ${counted(live.alarms_in_all, 'other', 'others')}`, recording };
}

/**
 * What somebody who looks at a recording must know of the live car; null: nothing.
 * @param {import('../core/protocol-types.js').LiveSummary | null | undefined} live
 * @returns {{kind: 'crit' | 'warn', text: string, asking: import('../core/protocol-types.js').StandingAlarm | null} | null} asking: a critical
 *   alarm that nobody has acknowledged
 */
export function asideOf(live) {
  if (!live) return { kind: 'warn', text: 'Live: unknown', asking: null };
  if (live.phase === 'lost' || (live.phase === 'monitoring' && live.cut !== null)) {
    const asking = byUrgency(live.alarms).find((alarm) => alarm.priority === 'critical' && alarm.state === 'UNACKED') ?? null;
    return { kind: 'crit', text: `Live: ${live.phase === 'lost' || live.cut === 'server-bridge' ? 'connection lost' : 'the car fell silent'}`, asking };
  }
  const urgent = byUrgency(live.alarms).filter((alarm) => alarm.priority !== 'advisory' && alarm.state !== 'SHELVED');
  const [worst] = urgent;
  if (!worst) return live.phase === 'monitoring' && live.paused ? { kind: 'warn', text: 'Live: monitoring is paused', asking: null } : null;
  const asking = urgent.find((alarm) => alarm.priority === 'critical' && alarm.state === 'UNACKED') ?? null;
  const more = urgent.length > 1 ? ` (${urgent.length} alarms)` : '';
  return { kind: worst.priority === 'critical' ? 'crit' : 'warn', text: `Live: ${titleOf(worst)}${more}`, asking };
}

/** @typedef {{topics?: Record<string, string | null>, units?: Record<string, string | null>}} Change null: as found */

/**
 * What is chosen for a replay, after one more choice.
 * @param {{topics: Record<string, string>, units: Record<string, string>}} before
 * @param {Change} change
 */
export function joinedChoices(before, { topics = {}, units = {} }) {
  return { topics: joined(before.topics, topics), units: joined(before.units, units) };
}

/** @param {Record<string, string>} before @param {Record<string, string | null>} change @returns {Record<string, string>} */
function joined(before, change) {
  return Object.fromEntries(Object.entries({ ...before, ...change }).flatMap(([name, value]) => (value === null ? [] : [[name, value]])));
}
