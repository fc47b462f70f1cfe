// The list of what to jump to in a recording: pure functions, no DOM.

import { categoryWords } from '../drive/mark-model.js';
import { CATEGORIES, KINDS } from '../drive/mode-text.js';
import { counted, duration, fixed } from '../core/format.js';
import { ICONS } from '../core/priority.js';

/** A jump leads to so long before what happened [s]: what led to it is seen. */
export const LEAD_S = 5;

/**
 * @typedef {import('../core/protocol-types.js').Timeline} Timeline
 * @typedef {{at_s: number, kind: import('../core/protocol-types.js').Priority | 'gap' | 'flag' | 'wheel', icon: string, title: string, text: string, length_s: number | null}} Jump
 *   length_s: how long it was active; null: not known, or to the end; of a mark or an intervention: 0
 */

/**
 * Alarms of every priority, what people marked, interventions, and where nothing was recorded, in the order of time.
 * @param {Pick<Timeline, 'marks' | 'gaps' | 'flags' | 'interventions'>} line
 * @returns {Jump[]}
 */
export function jumpsOf({ marks, gaps, flags, interventions }) {
  const alarms = marks.map((mark) => ({ at_s: mark.at_s, kind: mark.priority, icon: ICONS[mark.priority], title: mark.title, text: mark.text, length_s: mark.duration_s }));
  const holes = gaps.map(([from_s, to_s]) => ({ at_s: from_s, kind: /** @type {const} */ ('gap'), icon: 'unknown', title: 'Nothing recorded', text: '', length_s: to_s - from_s }));
  const marked = flags.map((flag) => ({ at_s: flag.at_s ?? 0, kind: /** @type {const} */ ('flag'), icon: 'flag', title: flag.words || 'Mark', text: [categoryWords(flag.category), flag.by ?? ''].filter(Boolean).join(' · '), length_s: 0 }));
  const taken = interventions.map(({ at_s, kind_of, category, what }) => ({ at_s, kind: /** @type {const} */ ('wheel'), icon: 'wheel', title: KINDS[kind_of]?.title ?? 'Intervention', text: [reasonWords(category), what].filter(Boolean).join(': ') || 'not described', length_s: 0 }));
  return [...alarms, ...holes, ...marked, ...taken].sort((a, b) => a.at_s - b.at_s);
}

/** What made somebody intervene, as it is read. @param {string | null} category */
const reasonWords = (category) => CATEGORIES.find(([name]) => name === category)?.[1] ?? category ?? '';

/** "3 alarms, 2 marks, 1 intervention". @param {Pick<Timeline, 'marks' | 'flags' | 'interventions'>} line */
export function jumpWords({ marks, flags, interventions }) {
  return [counted(marks.length, 'alarm'), ...(flags.length ? [counted(flags.length, 'mark')] : []), ...(interventions.length ? [counted(interventions.length, 'intervention')] : [])].join(', ');
}

/** Where a jump leads [s]. @param {Pick<Jump, 'at_s'>} jump */
export function jumpAt({ at_s }) {
  return Math.max(0, at_s - LEAD_S);
}

/**
 * "0.8 s", "12 s", "2:05 min"; or that it has no end yet.
 * @param {Pick<Jump, 'length_s'>} jump
 * @param {boolean} isDone whether all of the recording was read
 */
export function lengthOfJump({ length_s }, isDone) {
  if (length_s === 0) return '';
  if (length_s === null) return isDone ? 'to the end' : 'end not read yet';
  if (length_s < 59.5) return `${fixed(length_s, length_s < 9.95 ? 1 : 0)} s`;
  return `${duration(length_s)} ${length_s < 3600 ? 'min' : 'h'}`;
}

/**
 * The place of the last one that has begun at a moment, or of the first; −1 where there is none.
 * @param {number[]} begins in the order of time [s]
 * @param {number} at_s
 */
export function nearestJump(begins, at_s) {
  return begins.length === 0 ? -1 : Math.max(0, begins.filter((begin_s) => begin_s <= at_s + LEAD_S).length - 1);
}
