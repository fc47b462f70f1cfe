// The texts of a hand-over: what the taker reads back. Fetched with its sheet.

import { isLeftBehind, snackWords } from '../alarms/standing.js';
import { sinceTime, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').HandoverState} HandoverState
 * @typedef {import('../core/protocol-types.js').HandoverLine} HandoverLine
 */

/** The second line of a line. @param {HandoverLine} line */
export function lineWords({ kind, text, since_ms, until_ms, off_duty_ms }) {
  const plain = text.replace(/\.$/, '');
  const line = off_duty_ms ? `${plain}, off duty since ${sinceTime(off_duty_ms)}` : plain; // who has acknowledged it ends the text
  const since = since_ms === null ? '' : `${kind === 'alarm' ? 'began' : 'since'} ${timeOfDay(since_ms)}`;
  const until = until_ms === null ? '' : `back at ${timeOfDay(until_ms)}`;
  return [line, since || until].filter(Boolean).join(' · ');
}

/**
 * What people who are off duty by now left acknowledged, as lines to be read back; what was taken over here is read.
 * @param {import('../core/protocol-types.js').StandingAlarm[]} alarms
 * @param {import('../core/protocol-types.js').DutyState} me
 * @param {ReadonlySet<string>} taken
 * @returns {HandoverLine[]}
 */
export function leftLines(alarms, me, taken) {
  return alarms.flatMap((alarm) => {
    const key = `${alarm.id} ${alarm.occurrence}`;
    if (alarm.state !== 'ACKED' || !(taken.has(key) || isLeftBehind(alarm, me))) return [];
    const text = `${snackWords(alarm)}. Acknowledged by ${alarm.acknowledged_by}.`.replace('..', '.');
    return [{ key, kind: 'alarm', title: alarm.title, text, priority: alarm.priority, since_ms: alarm.raised_ms, until_ms: null, off_duty_ms: alarm.off_duty_ms ?? null, read: taken.has(key) }];
  });
}

/** The key below the list. @param {HandoverState} handover @param {'taker' | 'giver'} part */
export function endWords({ left, name, lines }, part) {
  const many = `${left} ${left === 1 ? 'line' : 'lines'} not read back yet`;
  if (part === 'giver') return { title: `${lines.length - left} of ${lines.length} read back`, text: left ? `${name}: ${many}` : `${name} can take over now`, isOpen: false };
  return { title: 'Take over control', text: left ? many : 'all lines are read back', isOpen: left === 0 };
}

/** The icon of a line. @param {HandoverLine} line */
export function markOf({ kind, priority, title }) {
  if (kind === 'alarm') return priority === 'critical' ? 'crit' : priority === 'warning' ? 'warn' : title === 'No alarm is active' ? 'ok' : 'info';
  if (kind === 'departure') return title === 'Departure check signed' ? 'ok' : 'info';
  return /** @type {const} */ ({ shelved: 'bell-off', limit: 'settings', rides: 'operator', driving: 'unknown', slow_down: 'slow', paused: 'pause', planned_stop: 'clock' })[kind];
}
