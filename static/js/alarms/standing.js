// How a standing alarm and the alarm load read: pure functions, no DOM.

import { ageWords, fixed, sinceTime, timeOfDay } from '../core/format.js';

/**
 * What is wrong, and how operators have responded.
 * @param {import('../core/protocol-types.js').StandingAlarm} alarm
 */
export function standingWords(alarm) {
  return joinWords(alarm.active ? snackWords(alarm) : alarm.trip_text || alarm.text, responseOf(alarm), markWords(alarm));
}

/** The mark of an alarm in a planned stop; empty: there is none. @param {Pick<import('../core/protocol-types.js').StandingAlarm, 'planned_stop'>} alarm */
export const markWords = ({ planned_stop }) => (planned_stop ? 'planned stop' : '');

/** Sentences in one line, of which the last alone keeps its full stop. @param {string[]} parts */
export const joinWords = (...parts) => parts.filter(Boolean).join(' · ').replaceAll('. · ', ' · ');

/**
 * What the snackbar tells: what is wrong now; of what is over, what it was.
 * @param {import('../core/protocol-types.js').StandingAlarm} alarm
 */
export function snackWords(alarm) {
  const was = alarm.trip_text && alarm.trip_text !== alarm.title ? ` It was: ${alarm.trip_text}` : ''; // its title stands above
  if (!alarm.active) return `Returned to normal.${was || ` ${worstWords(alarm)}`.trimEnd()}`;
  if (alarm.verdict === 'ok') return `Returning to normal: ${alarm.text || 'OK'}.${was}`; // it clears once that has lasted
  return alarm.verdict === 'unknown' ? `Not checked now: ${lowered(bare(alarm.text || 'unknown'), alarm.causes ?? [])}.${was}` : alarm.text || alarm.trip_text || alarm.title;
}

/**
 * The sentences of an alarm's dialog: what is wrong where no two numbers say it, since when and with what it began, what to do.
 * @param {import('../core/protocol-types.js').StandingAlarm} alarm
 */
export function dialogWords(alarm) {
  const at = timeOfDay(alarm.raised_ms);
  const trip = alarm.trip_text && alarm.trip_text !== alarm.text ? `: ${lowered(bare(alarm.trip_text), alarm.causes ?? [])}` : '';
  const began = `Began ${at}${trip}.`;
  const worst = worstWords(alarm);
  const mark = alarm.planned_stop ? 'The car is in a planned stop.' : '';
  if (!alarm.active) return ['It has returned to normal.', began, worst, mark].filter(Boolean).join(' ');
  const isBlind = alarm.verdict === 'unknown';
  const cause = isBlind ? `Not checked now: ${lowered(bare(alarm.text), alarm.causes ?? [])}.` : alarm.verdict === 'ok' ? `Returning to normal: ${bare(alarm.text)}.` : alarm.measured && alarm.limit ? '' : `${bare(alarm.text)}.`;
  return [cause, `Active for ${ageWords(alarm.for_s)}.`, began, worst, mark, alarm.advice].filter(Boolean).join(' ');
}

/** How bad it was, where that is not what is measured now. @param {import('../core/protocol-types.js').StandingAlarm} alarm */
function worstWords({ active, verdict, measured, worst }) {
  if (!worst) return '';
  const isNow = active && verdict !== 'unknown' && measured && fixed(measured.value) === fixed(worst.value);
  return isNow ? '' : `${worst.side === 'above' ? 'Highest' : 'Lowest'} ${fixed(worst.value)} ${worst.unit}.`;
}

/**
 * A sentence within another one: its first letter is small, unless it begins with a name or an abbreviation.
 * @param {string} sentence @param {string[]} names what may be a name in it
 */
export function lowered(sentence, names) {
  const isName = names.some((name) => sentence.startsWith(name)) || !/^[A-Z][a-z]*[ :,]/.test(sentence);
  return isName ? sentence : sentence.charAt(0).toLowerCase() + sentence.slice(1);
}

/** A sentence without its end. @param {string} sentence */
function bare(sentence) {
  return sentence.replace(/[.!?]$/, '');
}

/** Who has acknowledged it, and since when they are off duty. @param {Pick<import('../core/protocol-types.js').StandingAlarm, 'acknowledged_by' | 'off_duty_ms'>} alarm */
export function ownerWords({ acknowledged_by, off_duty_ms }) {
  return `acknowledged${acknowledged_by ? ` by ${acknowledged_by}` : ''}${off_duty_ms ? `, off duty since ${sinceTime(off_duty_ms)}` : ''}`;
}

/** Whether another person left it acknowledged who is off duty by now; who is on duty again owns what they had. @param {import('../core/protocol-types.js').StandingAlarm} alarm @param {{name: string}} me */
export function isLeftBehind({ off_duty_ms, acknowledged_by }, me) {
  return Boolean(off_duty_ms) && !acknowledged_by?.startsWith(`${me.name} (`);
}

/** @param {import('../core/protocol-types.js').StandingAlarm} alarm */
function responseOf(alarm) {
  const by = (/** @type {string | null | undefined} */ who) => (who ? ` by ${who}` : '');
  if (alarm.state === 'SHELVED') return `shelved${by(alarm.shelved_by)} until ${timeOfDay(alarm.shelved_until_ms)}`;
  if (alarm.state === 'ACKED') return ownerWords(alarm);
  return alarm.state === 'RTN_UNACKED' ? 'ended, unacknowledged' : 'unacknowledged';
}

/**
 * When there are too many alarms to work by: "Alarm flood: 12 in 10 min", and which chatter; else nothing.
 * @param {import('../core/protocol-types.js').AlarmLoad | undefined} load
 */
export function loadWords(load) {
  if (!load) return '';
  const flood = load.flood ? `Alarm flood: ${load.in_10_min} in 10 min` : '';
  return [flood, load.chattering.length ? `Chattering: ${load.chattering.join(', ')}` : ''].filter(Boolean).join(' · ');
}
