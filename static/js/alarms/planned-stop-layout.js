// The texts of a planned stop. Pure functions, no DOM.

import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').PlannedStopState} PlannedStop
 * @typedef {PlannedStop['reason']} Reason
 */

/** Why a car stands on purpose, as a key reads. */
export const REASONS = /** @type {Record<Reason, string>} */ ({
  parked: 'Parked', workshop: 'In the workshop', charging: 'Charging or refuelling', set_up: 'Being set up',
});
const MEANING = 'Its alarms are marked, and recorded as ever. Only critical ones and those of catgraph itself sound.';
const ENDS = 'It ends by itself when the car moves.';
export const UNKNOWN = 'Speed not known: ends by hand only.';
const NOT_KNOWN = 'Speed not known: it does not end by itself until it is.';

/** "Planned stop: in the workshop". @param {Reason} reason one of another version is not named */
export function titleOf(reason) {
  return ['Planned stop', REASONS[reason]?.toLowerCase()].filter(Boolean).join(': ');
}

/** The line under the strip: since when and by whom. @param {PlannedStop} stop */
export function lineWords({ since_ms, by }) {
  return `since ${timeOfDay(since_ms)}${by ? ` by ${by}` : ''}`;
}

/** The text of the sheet. @param {PlannedStop | null} stop */
export function sheetWords(stop) {
  return stop ? `${MEANING} ${stop.is_speed_known ? ENDS : NOT_KNOWN}` : `The car stands on purpose. ${MEANING} ${ENDS}`;
}
