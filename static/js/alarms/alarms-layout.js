// The list of alarms as text: the order of its rows, the text of each state, the keys of a row. Pure functions, no DOM.

import { byUrgency } from './alarm-layout.js';
import { markWords, ownerWords, snackWords } from './standing.js';
import { ageWords, fixed, timeOfDay } from '../core/format.js';
import { ICONS } from '../core/priority.js';

/**
 * @typedef {import('../core/protocol-types.js').StandingAlarm} Alarm
 * @typedef {import('../core/protocol-types.js').SuppressedAlarm} Suppressed
 * @typedef {'unacknowledged' | 'returned' | 'acknowledged' | 'shelved' | 'suppressed'} Kind
 * @typedef {'silence' | 'acknowledge' | 'shelve' | 'unshelve' | 'take_alarm'} Key
 * @typedef {{key: string, id: string, kind: Kind, icon: string, priority: string, title: string, detail: string, at: string, state: string, silent: string, keys: Key[], alarm: Alarm | null}} Row
 */

const KINDS = /** @type {Record<Alarm['state'], Kind>} */ ({ UNACKED: 'unacknowledged', RTN_UNACKED: 'returned', ACKED: 'acknowledged', SHELVED: 'shelved' });

/** @param {Pick<Alarm, 'state'>} alarm @returns {Kind} */
export function kindOf({ state }) {
  return KINDS[state] ?? 'acknowledged';
}

/**
 * The rows, top to bottom.
 * @param {Alarm[]} alarms
 * @param {Suppressed[]} suppressed
 * @param {boolean} mayAct false for a viewer and in a replay: they only read
 * @returns {Row[]}
 */
export function rowsOf(alarms, suppressed, mayAct) {
  return [...byUrgency(alarms).map((alarm) => rowOf(alarm, mayAct)), ...suppressed.map(suppressedRow)];
}

/** @param {Alarm} alarm @param {boolean} mayAct @returns {Row} */
function rowOf(alarm, mayAct) {
  const kind = kindOf(alarm);
  return {
    key: `${alarm.id} ${alarm.occurrence} ${alarm.state}`, id: alarm.id, kind, icon: kind === 'shelved' ? 'clock' : ICONS[alarm.priority], priority: alarm.priority, title: alarm.title,
    detail: detailOf(alarm), at: timeOfDay(alarm.raised_ms), state: listedWords(alarm), silent: silentWords(alarm), keys: mayAct ? keysOf(alarm) : [], alarm,
  };
}

/**
 * What can be done about an alarm, the first answer last: where the thumb is.
 * @param {Alarm} alarm
 * @returns {Key[]}
 */
export function keysOf(alarm) {
  const kind = kindOf(alarm);
  if (kind === 'shelved') return ['unshelve'];
  if (kind === 'returned') return ['acknowledge'];
  if (kind === 'acknowledged') return [...(alarm.actions.includes('shelve') ? /** @type {Key[]} */ (['shelve']) : []), ...(alarm.off_duty_ms ? /** @type {Key[]} */ (['take_alarm']) : [])];
  return alarm.sound === 'none' || alarm.silenced_until_ms ? ['acknowledge'] : ['silence', 'acknowledge'];
}

/** The measured value against its limit, as short as possible. @param {Alarm} alarm */
function detailOf(alarm) {
  const { active, verdict, measured, limit } = alarm;
  if (!active) return alarm.trip_text || alarm.text;
  const isCompared = verdict === 'fault' && measured && limit && measured.unit === limit.unit && measured.value !== null && limit.value !== null;
  return isCompared ? comparedWords(measured, limit) : snackWords(alarm);
}

const LIMITS = new Set(['', 'Allowed', 'At most', 'Limit', 'Reported after']);

/**
 * "no message for 16.4 s (limit 1.0 s)", "12.6 m/s (limit 11.0 m/s)", "5.0 Hz (expected 20.0 Hz)", "5 of 7".
 * @param {import('../core/protocol-types.js').Quantity} measured
 * @param {import('../core/protocol-types.js').Quantity} limit
 */
export function comparedWords(measured, limit) {
  if (limit.label === 'Of') return `${fixed(measured.value, 0)} of ${fixed(limit.value, 0)}`;
  const before = measured.label === 'Silent for' ? 'no message for ' : / for$/.test(measured.label) ? `${measured.label.toLowerCase()} ` : '';
  const [now, least] = [measured, limit].map(({ value, unit }) => `${fixed(value)} ${unit}`.trim());
  return `${before}${now} (${LIMITS.has(limit.label ?? '') ? 'limit' : limit.label.toLowerCase()} ${least})`;
}

/** @param {Suppressed} one @returns {Row} */
function suppressedRow({ id, title, priority, by, raised_ms }) {
  return {
    key: `${id} suppressed`, id, kind: 'suppressed', icon: 'bell-off', priority, title, detail: `cause: ${by.join(', ')}`, at: raised_ms === null ? '' : timeOfDay(raised_ms),
    state: 'suppressed', silent: '', keys: [], alarm: null,
  };
}

/** The state of an alarm in the terms of ISA-18.2. @param {Alarm} alarm */
export function stateWords(alarm) {
  const by = (/** @type {string | null | undefined} */ who) => (who ? ` by ${who}` : '');
  if (alarm.state === 'SHELVED') return `shelved until ${timeOfDay(alarm.shelved_until_ms)}${by(alarm.shelved_by)}`;
  if (alarm.state === 'RTN_UNACKED') return 'ended, unacknowledged';
  return alarm.state === 'ACKED' ? ownerWords(alarm) : 'unacknowledged';
}

/** Its state in a list: of one that is acknowledged for how long it has been active, and whether the car stands on purpose. @param {Alarm} alarm */
function listedWords(alarm) {
  const age = alarm.state === 'ACKED' && alarm.active ? `active for ${ageWords(alarm.for_s)}` : '';
  return [stateWords(alarm), age, markWords(alarm)].filter(Boolean).join(' · ');
}

/** Who took its sound, and until when; empty: nobody did. @param {Alarm} alarm */
export function silentWords({ silenced_until_ms, silenced_by }) {
  return silenced_until_ms ? `silent until ${timeOfDay(silenced_until_ms)}${silenced_by ? ` by ${silenced_by}` : ''}` : '';
}

/** "3 unacknowledged"; what is shelved, suppressed, or of somebody who is off duty is not called acknowledged. @param {Row[]} rows */
export function countWords(rows) {
  const unowned = rows.filter(({ alarm }) => alarm?.off_duty_ms).length;
  const waiting = rows.filter(({ kind }) => kind === 'unacknowledged' || kind === 'returned').length;
  return waiting ? `${waiting} unacknowledged` : unowned ? `${unowned} without an owner on duty` : rows.length === 0 ? '' : rows.some(({ kind }) => kind !== 'acknowledged') ? 'none to acknowledge' : 'all acknowledged';
}
