// The list of alarms as words: which row stands where, how its state reads, what its keys are. Pure functions, no DOM.

import { snackWords } from './standing.js';
import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol.js').Alarm} Alarm
 * @typedef {import('../core/protocol.js').Suppressed} Suppressed
 * @typedef {'unacknowledged' | 'returned' | 'acknowledged' | 'shelved' | 'suppressed'} Kind
 * @typedef {{key: string, kind: Kind, icon: string, priority: string, title: string, words: string, at: string, state: string, keys: ('acknowledge' | 'shelve' | 'unshelve')[], alarm: Alarm | null}} Row
 */

const ORDER = /** @type {Kind[]} */ (['unacknowledged', 'returned', 'acknowledged', 'shelved', 'suppressed']);
const RANK = { critical: 0, warning: 1, advisory: 2 };
const ICONS = { critical: 'crit', warning: 'warn', advisory: 'info' };
const KINDS = /** @type {Record<Alarm['state'], Kind>} */ ({ UNACKED: 'unacknowledged', RTN_UNACKED: 'returned', ACKED: 'acknowledged', SHELVED: 'shelved' });

/**
 * What waits for the operator first, and of it what still stands; then by danger, then the newest.
 * @param {Alarm[]} alarms
 */
export function byDanger(alarms) {
  const place = (/** @type {Alarm} */ { state }) => ORDER.indexOf(KINDS[state] ?? 'acknowledged');
  return [...alarms].sort((a, b) => place(a) - place(b) || RANK[a.priority] - RANK[b.priority] || b.raised_ms - a.raised_ms);
}

/**
 * The rows, top to bottom.
 * @param {Alarm[]} alarms
 * @param {Suppressed[]} suppressed
 * @param {boolean} mayAct a viewer, and whoever looks at a recording, only reads
 * @returns {Row[]}
 */
export function rowsOf(alarms, suppressed, mayAct) {
  return [...byDanger(alarms).map((alarm) => rowOf(alarm, mayAct)), ...suppressed.map(suppressedRow)];
}

/** @param {Alarm} alarm @param {boolean} mayAct @returns {Row} */
function rowOf(alarm, mayAct) {
  const kind = KINDS[alarm.state] ?? 'acknowledged';
  /** @type {Row['keys']} */
  const keys = kind === 'unacknowledged' || kind === 'returned' ? ['acknowledge'] : [];
  if (kind === 'shelved') keys.push('unshelve');
  else if (kind !== 'returned' && alarm.actions.includes('shelve')) keys.unshift('shelve');
  return {
    key: `${alarm.id} ${alarm.occurrence} ${alarm.state}`, kind, icon: kind === 'shelved' ? 'clock' : ICONS[alarm.priority], priority: alarm.priority, title: alarm.title,
    words: kind === 'returned' ? alarm.trip_text || alarm.text : snackWords(alarm), at: timeOfDay(alarm.raised_ms), state: stateWords(alarm), keys: mayAct ? keys : [], alarm,
  };
}

/** @param {Suppressed} one @returns {Row} */
function suppressedRow({ id, title, priority, by, raised_ms }) {
  return {
    key: `${id} suppressed`, kind: 'suppressed', icon: 'unknown', priority, title, words: `cause: ${by.join(', ')}`, at: raised_ms === null ? '' : timeOfDay(raised_ms),
    state: 'suppressed', keys: [], alarm: null,
  };
}

/** The state of an alarm in the words of ISA-18.2. @param {Alarm} alarm */
export function stateWords(alarm) {
  const by = (/** @type {string | null | undefined} */ who) => (who ? ` by ${who}` : '');
  if (alarm.state === 'SHELVED') return `shelved until ${timeOfDay(alarm.shelved_until_ms)}${by(alarm.shelved_by)}`;
  if (alarm.state === 'RTN_UNACKED') return 'returned unacknowledged';
  return alarm.state === 'ACKED' ? `acknowledged${by(alarm.acknowledged_by)}` : 'unacknowledged';
}

/** "3 unacknowledged"; what is shelved or suppressed is not called acknowledged. @param {Row[]} rows */
export function countWords(rows) {
  const waiting = rows.filter(({ kind }) => kind === 'unacknowledged' || kind === 'returned').length;
  return waiting ? `${waiting} unacknowledged` : rows.length === 0 ? '' : rows.some(({ kind }) => kind !== 'acknowledged') ? 'none to acknowledge' : 'all acknowledged';
}

/**
 * What stands in place of an empty list: "no alarms" only where alarms could have come.
 * @param {{isSilent: boolean, isReplay: boolean, isPaused: boolean, isChecked: boolean}} seen isChecked: messages of the car are judged
 */
export function noneWords({ isSilent, isReplay, isPaused, isChecked }) {
  if (isSilent) return 'Alarms unknown: the server does not answer.';
  if (isPaused) return isReplay ? 'Monitoring was paused: no alarm could be raised.' : 'Monitoring is paused: no alarm can be raised.';
  if (!isChecked) return isReplay ? 'Nothing recorded yet: nothing is checked.' : 'No message from the car: nothing is checked.';
  return isReplay ? 'No alarms at this moment of the recording.' : 'No alarms.';
}
