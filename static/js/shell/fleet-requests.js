// Who is called next for an item, and requests for control of a car that another has: pure functions for the attention queue.

import { counted, duration, sinceTime } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').AttentionItem} AttentionItem
 * @typedef {import('../core/protocol-types.js').CarSummary} CarSummary
 */

/** What happens to an item that goes on to the supervisor, or went. @param {AttentionItem} attention @param {number} now_ms @returns {string} '' where no timer runs */
export function supervisorWords({ escalated_ms, escalates_ms, supervisors }, now_ms) {
  const names = supervisors?.join(', ');
  if (escalated_ms !== null) {
    const since = duration((now_ms - escalated_ms) / 1000);
    if (names === undefined) return `at Supervisor for ${since}`;
    return names ? `escalated to ${names} for ${since}` : `escalated: no supervisor is on duty, ${since}`;
  }
  if (escalates_ms === null) return '';
  const left = duration(Math.ceil(Math.max(0, escalates_ms - now_ms) / 1000));
  return names === '' ? `Supervisor in ${left}: none on duty` : `${names ?? 'Supervisor'} in ${left}`;
}

/** What people who are off duty by now left acknowledged. @param {CarSummary} summary @returns {string} '' where nothing is left so */
export function unownedWords({ unowned }) {
  return unowned ? `${unowned.count > 1 ? `${unowned.count} alarms ` : ''}acknowledged by ${unowned.by}, off duty since ${sinceTime(unowned.since_ms)}` : '';
}

/**
 * A request for control of a car that is not answered yet; without an answer it is granted.
 * @param {string} name
 * @param {CarSummary} summary
 * @param {number} age_s of the summary
 * @returns {import('./fleet-layout.js').Item | null}
 */
export function requestItem(name, { requests, holder }, age_s) {
  const [first, ...more] = requests ?? [];
  if (!first || !holder) return null;
  const left_s = Math.max(0, Math.ceil(first.left_s - age_s));
  const others = more.length ? `. ${counted(more.length, 'other request', 'other requests')}` : '';
  return {
    key: `${name} control`, cars: [name], name, icon: 'info', kind: '', isFilled: false, title: `${first.name} requests control`,
    detail: `Granted in ${left_s} s unless ${holder} keeps it${others}`, since_s: null, who: { text: `${holder} is in control`, is: 'other' }, next: '', timer: null,
    keys: [{ act: 'open', label: 'Open', isMain: true }], order: [3, 0, 0, -left_s], cause: '', raised_s: 0, isUnassigned: false, sound: 'none',
  };
}
