// Which part of a drive its chart shows, and whether it goes on with the drive.

import { timeOfDay } from '../core/format.js';
import { LEAST_S, within } from './drive-layout.js';

/** @typedef {import('./drive-layout.js').View} View */

export class DriveView {
  /** @type {View} */
  view = [-300, 60];
  /** The width that was chosen; the whole drive where it is infinite. */
  range_s = 360;
  /** The right edge moves with the drive; in a replay the view follows the moment. */
  follows = true;

  /**
   * Moves on with the drive, or with the moment of a replay.
   * @param {number} end_s of the drive
   * @param {{at_s: number} | undefined} replay
   */
  keepUp(end_s, replay) {
    if (!this.follows) return;
    const width_s = this.range_s === Infinity ? Math.max(end_s, LEAST_S) : this.range_s;
    if (!replay || this.range_s === Infinity) {
      this.view = [end_s - width_s, end_s];
      return;
    }
    const [begin_s, to_s] = this.view;
    const isSeen = to_s - begin_s === width_s && replay.at_s >= begin_s && replay.at_s <= to_s;
    if (!isSeen) this.view = within([replay.at_s - width_s / 2, replay.at_s + width_s / 2], Math.max(end_s, width_s));
  }

  /**
   * Another part; at the right edge of a live drive it goes on with it.
   * @param {View} view
   * @param {number} end_s
   * @param {boolean} isReplay
   */
  set([from_s, to_s], end_s, isReplay) {
    const width_s = Math.max(LEAST_S, Math.min(to_s - from_s, Math.max(end_s, LEAST_S)));
    this.view = within([from_s, from_s + width_s], end_s);
    this.follows = !isReplay && this.view[1] >= end_s - width_s / 200;
    if (this.follows) this.range_s = width_s >= end_s - 0.01 ? Infinity : width_s;
  }

  /** @param {number} [range_s] */
  follow(range_s = this.range_s) {
    this.range_s = range_s;
    this.follows = true;
  }
}

/**
 * What must be known of what is seen; '': it is live, or all of a recording.
 * @param {{answer: import('./drive-layout.js').Answer | null, isLate: boolean}} feed
 * @param {View} view
 * @param {boolean} follows
 * @param {boolean} isReplay
 */
export function stateWords({ answer, isLate }, view, follows, isReplay) {
  if (!answer) return 'Loading…';
  const clock = (/** @type {number} */ at_s) => timeOfDay(answer.start_ms + at_s * 1000);
  if (isReplay && answer.is_sketch) return 'Sketch: the recording is still being read';
  if (isReplay) return answer.known_s < answer.length_s - 0.5 ? `Read up to ${clock(answer.known_s)}` : emptyWords(answer, true);
  if (!follows) return `Held at ${clock(view[1])}: not live`;
  return isLate ? `No answer since ${clock(answer.known_s)}` : emptyWords(answer, false);
}

/**
 * What would fill the chart where none of its signals has come in this drive; '': one has.
 * @param {import('./drive-layout.js').Answer} answer
 * @param {boolean} isReplay
 */
export function emptyWords({ signals, offered }, isReplay) {
  const names = Object.keys(signals);
  if (!names.length || names.some((name) => offered[name]?.has_data !== false)) return '';
  const labels = names.map((name) => offered[name]?.label ?? name).join(', ');
  return isReplay ? `The recording holds no ${labels}. Choose another signal.` : `No ${labels} yet. The first message draws it; Settings has its topic.`;
}
