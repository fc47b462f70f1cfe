// The alarm log as text: the text of an event, the rows of a filter, the day of a row. Pure functions, no DOM.

import { rowsOf } from './alarms-layout.js';
import { standingWords } from './standing.js';
import { gapWords } from '../core/event-log.js';
import { age } from '../core/format.js';
import { unseenWords } from '../core/unseen.js';

/**
 * @typedef {import('../core/protocol-types.js').LogEvent} AlarmEvent
 * @typedef {import('../core/event-log.js').Row} Row
 * @typedef {'all' | 'critical' | 'warning' | 'advisory' | 'other'} Kind other: what is no alarm (paused, connected, settings …)
 * @typedef {{kind: Kind, text: string}} Filter
 */

export const KINDS = /** @type {const} */ ([
  ['all', 'All'], ['critical', 'Critical'], ['warning', 'Warning'], ['advisory', 'Advisory'], ['other', 'Other'],
]);
export const MARKS = { critical: ['crit', 'c-crit'], warning: ['warn', 'c-warn'], advisory: ['info', ''] };
const CHANGES = /** @type {Record<string, string>} */ ({
  raised: '', recaused: 'again', cleared: ': ended', acknowledged: 'acknowledged', shelved: 'shelved', unshelved: 'no longer shelved', silenced: 'silenced', unsilenced: 'sounds again',
  suppressed: 'not announced', unsuppressed: 'announced again', handed_over: 'taken over', unacknowledged: 'unacknowledged again',
});
const RISES = new Set(['raised', 'recaused', 'unsuppressed', 'unacknowledged']);
const SLOWING = new Set(['armed', 'disarmed', 'slow_down']);
const DAYS = ['Sunday', 'Monday', 'Tuesday', 'Wednesday', 'Thursday', 'Friday', 'Saturday'];
const MONTHS = ['January', 'February', 'March', 'April', 'May', 'June', 'July', 'August', 'September', 'October', 'November', 'December'];

/**
 * How one event reads.
 * @param {AlarmEvent} event
 */
export function eventWords(event) {
  const row = wordsOf(event);
  return event.brought_from ? { ...row, text: [row.text, `brought back from ${event.brought_from}`].filter(Boolean).join(' · ') } : row;
}

/** @param {AlarmEvent} event */
function wordsOf(event) {
  if (event.alarm === null && SLOWING.has(event.change)) {
    const [mark, kind] = event.step === 'not_confirmed' ? ['crit', 'c-crit'] : ['slow', 'c-order'];
    return { icon: mark, kind, title: event.text || event.change, text: event.by ? `by ${event.by}` : '' };
  }
  if (event.alarm === null) return { icon: event.change === 'lost' || event.change === 'stalled' ? 'link-off' : 'info', kind: '', title: event.text || event.change, text: event.by ? `by ${event.by}` : '' };
  const change = CHANGES[event.change] ?? event.change;
  const isRise = !Object.hasOwn(CHANGES, event.change) || RISES.has(event.change); // a change of another version is no comfort
  const [mark, kind] = isRise ? MARKS[event.priority ?? 'advisory'] : ['ok', ''];
  return {
    icon: mark ?? 'info', kind: kind ?? '', title: `${event.title ?? event.alarm}${/^[ :]|^$/.test(change) ? '' : ' '}${change}`, // as the strip has it
    text: [event.text, hiddenWords(event), event.planned_stop ? 'planned stop' : '', event.by ? `by ${event.by}` : ''].filter(Boolean).join(' · '),
  };
}

/** Whether nobody was alerted of it because it was shelved, or explained by others. @param {AlarmEvent} event */
function hiddenWords({ state, change, suppressed_by }) {
  if (state === 'SHELVED') return change === 'shelved' ? '' : 'while shelved';
  if (state !== 'SUPPRESSED') return '';
  return suppressed_by?.includes('paused') ? 'suppressed: monitoring is paused' : 'suppressed by another alarm';
}

/**
 * The standing alarms in the form of the log: who has seen it, then what is suppressed; what is hidden bears its own icon.
 * @param {import('../core/protocol-types.js').StandingAlarm[]} alarms
 * @param {import('../core/protocol-types.js').SuppressedAlarm[]} suppressed
 * @returns {{icon: string, colour: string, title: string, text: string, at: string, kind: string}[]}
 */
export function standingRows(alarms, suppressed) {
  return rowsOf(alarms, suppressed, false).map(({ kind, icon, priority, title, state, alarm, at, detail: cause }) => ({
    icon, colour: kind === 'shelved' || kind === 'suppressed' ? '' : MARKS[/** @type {keyof typeof MARKS} */ (priority)]?.[1] ?? '',
    title, text: alarm ? standingWords(alarm) : `${state} · ${cause}`, at, kind,
  }));
}

/**
 * Does a filter leave this event? As the server filters, so that what is here and what is fetched make one list.
 * @param {AlarmEvent} event
 * @param {Filter} filter
 */
export function fits(event, { kind, text }) {
  if (kind === 'other' ? event.alarm !== null : kind !== 'all' && event.priority !== kind) return false;
  const wanted = text.trim().toLowerCase();
  if (!wanted) return true;
  return [event.title, event.text, event.by, event.alarm, event.change].map((part) => part ?? '').join(' ').toLowerCase().includes(wanted);
}

/**
 * The same filter for the server.
 * @param {Filter} filter
 * @returns {Record<string, string>}
 */
export function filterParams({ kind, text }) {
  const wanted = text.trim();
  return {
    ...(kind === 'other' ? { alarm: '' } : kind === 'all' ? {} : { priority: kind }),
    ...(wanted ? { text: wanted } : {}),
  };
}

/**
 * One list, newest first: what this page received, with the times in which it was blind, and the older events of the server.
 * A blind time is shown whatever the filter: nobody knows what would have stood there.
 * @param {Row[]} here newest first
 * @param {AlarmEvent[]} older newest first, from the server
 * @param {Filter} filter
 * @returns {Row[]}
 */
export function joined(here, older, filter) {
  const known = new Set(here.map(({ event }) => event?.n));
  const before = older.filter((event) => !known.has(event.n)).map((event) => ({ event, gap: null }));
  return [...here, ...before].filter(({ event }) => !event || fits(event, filter));
}

/**
 * A blind time with how far the car may have driven in it: "Blind 14 s: 2 alarms raised, 1 cleared, ≤ 81.2 m unseen".
 * @param {import('../core/event-log.js').Gap} gap
 */
export function gapLine(gap) {
  return gap.unseen_m === undefined ? gapWords(gap) : `${gapWords(gap)}, ${unseenWords(gap.unseen_m)}`;
}

/**
 * The number below which more is requested from the server.
 * @param {Row[]} here
 * @returns {number | null} null: from the newest on
 */
export function lowest(here) {
  const numbers = here.flatMap(({ event }) => (event ? [event.n] : []));
  return numbers.length ? Math.min(...numbers) : null;
}

/**
 * "Today", "Yesterday", "Friday, 20 November", with the year where it is another.
 * @param {number} at_ms
 * @param {number} now_ms
 */
export function dayWords(at_ms, now_ms) {
  const [day, today] = [new Date(at_ms), new Date(now_ms)];
  const days = Math.round((midnight(today) - midnight(day)) / 86_400_000); // a day of 23 or 25 hours is a day
  if (days === 0) return 'Today';
  if (days === 1) return 'Yesterday';
  const year = day.getFullYear() === today.getFullYear() ? '' : ` ${day.getFullYear()}`;
  return `${DAYS[day.getDay()]}, ${day.getDate()} ${MONTHS[day.getMonth()]}${year}`;
}

/** @param {Date} date */
function midnight(date) {
  return new Date(date.getFullYear(), date.getMonth(), date.getDate()).getTime();
}

/**
 * The text of an acknowledgement with its delay: "12.6 m/s · by Ann · after 2.3 s".
 * @param {AlarmEvent} event an acknowledgement
 * @param {Row[]} rows
 */
export function tookWords(event, rows) {
  if (event.change !== 'acknowledged') return '';
  const raised = rows.find((row) => row.event && row.event.alarm === event.alarm && row.event.occurrence === event.occurrence && RISES.has(row.event.change));
  return raised?.event ? `after ${age((event.at_ms - raised.event.at_ms) / 1000)} s` : '';
}
