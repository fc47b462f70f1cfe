// How a standing alarm and the alarm load read: pure functions, no DOM.

import { timeOfDay } from './words.js';

/**
 * What is wrong, and who has said what to it.
 * @param {import('./protocol.js').Alarm} alarm
 */
export function standingWords(alarm) {
  return [alarm.text || alarm.trip_text, said(alarm)].filter(Boolean).join(' · ');
}

/** @param {import('./protocol.js').Alarm} alarm */
function said(alarm) {
  const by = (/** @type {string | null | undefined} */ who) => (who ? ` by ${who}` : '');
  if (alarm.state === 'SHELVED') return `shelved${by(alarm.shelved_by)} until ${timeOfDay(alarm.shelved_until_ms)}`;
  if (alarm.state === 'ACKED') return `acknowledged${by(alarm.acknowledged_by)}`;
  return alarm.state === 'RTN_UNACKED' ? 'over, not acknowledged' : 'not acknowledged';
}

/**
 * "Alarm load: 3 in 10 min", with the word "flood" when it is one.
 * @param {import('./protocol.js').AlarmLoad | undefined} load
 */
export function loadWords(load) {
  if (!load) return '';
  const chattering = load.chattering.length ? ` · chattering: ${load.chattering.join(', ')}` : '';
  return `Alarm load: ${load.in_10_min} in 10 min${load.flood ? ': flood' : ''}${chattering}`;
}
