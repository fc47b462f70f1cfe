// The log beside a replay: what the recording holds up to the moment that is shown, newest first.

import { MARKS } from '../alarms/log-layout.js';
import { counted, timeOfDay } from '../core/format.js';
import { recordedLine } from './replay.js';
import { jumpsOf, lengthOfJump } from './replay-jumps-layout.js';

/**
 * @typedef {import('../core/protocol-types.js').Timeline} Timeline
 * @typedef {{at_ms: number, icon: string, kind: string, title: string, text: string, priority: string | null}} Line
 *   kind: the class of its icon
 */

/**
 * @param {Timeline | null} line the time line as far as it is made; null: none of it
 * @param {Pick<import('../core/protocol-types.js').ReplayState, 'at_s' | 'start_ms'>} replay the moment that is shown
 * @returns {Line[]}
 */
export function recordedLines(line, { at_s, start_ms }) {
  const at_ms = start_ms + at_s * 1000;
  const notice = (/** @type {string} */ title, text = '') => ({ at_ms, icon: 'clock', kind: '', title, text, priority: null });
  if (!line) return [notice('The recording is being read')];
  const begun = jumpsOf(line).filter((jump) => jump.at_s <= at_s);
  const lines = begun.flatMap((jump) => {
    const [icon, kind] = jump.kind === 'gap' ? ['link-off', ''] : MARKS[/** @type {keyof typeof MARKS} */ (jump.kind)] ?? ['info', ''];
    const end_s = jump.length_s ? jump.at_s + jump.length_s : null;
    const began = { at_ms: start_ms + jump.at_s * 1000, icon: icon ?? 'info', kind: kind ?? '', title: jump.title, text: jump.text, priority: jump.kind in MARKS ? jump.kind : null };
    if (end_s === null || end_s > at_s) return [began];
    return [began, { ...began, at_ms: start_ms + end_s * 1000, icon: 'ok', kind: '', title: `${jump.title}: ended`, text: `after ${lengthOfJump(jump, true)}`, priority: null }];
  }).sort((a, b) => b.at_ms - a.at_ms);
  const left = line.marks_left_out ? [notice(`${counted(line.marks_left_out, 'more alarm')} not listed`)] : [];
  const unread = !line.is_done && at_s > line.done_s ? [notice('Not read yet', `events after ${timeOfDay(start_ms + line.done_s * 1000)} are not listed`)] : [];
  return [...unread, ...left, ...lines];
}

/** Of the recording that this page shows. @param {import('../core/protocol-types.js').ReplayState} replay */
export const shownLines = (replay) => recordedLines(recordedLine(), replay);
