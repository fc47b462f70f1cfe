// The texts of the list of people. Fetched with the list.

import { timeOfDay } from '../core/format.js';

/** @typedef {import('../core/protocol-types.js').PersonRow} PersonRow */

const DAY_MS = 86_400_000;

/** When somebody was on duty last. @param {PersonRow} row @param {number} now_ms */
export function lastWords({ last_ms, duty }, now_ms) {
  if (duty) return `on duty at ${duty.device} since ${timeOfDay(duty.since_ms).slice(0, 5)}`;
  if (last_ms === null) return 'no shift yet';
  const at = new Date(last_ms);
  const days = Math.round((new Date(now_ms).setHours(0, 0, 0, 0) - new Date(last_ms).setHours(0, 0, 0, 0)) / DAY_MS);
  if (days <= 0) return `last shift today ${timeOfDay(last_ms).slice(0, 5)}`;
  return `last shift ${days === 1 ? 'yesterday' : at.toLocaleDateString('en-GB', { day: 'numeric', month: 'short' })}`;
}
