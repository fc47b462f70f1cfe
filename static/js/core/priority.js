// How urgent an alarm is, and what is made of one of another version: whatever this page does not know of it is the most urgent. Pure functions.

/**
 * @typedef {import('./protocol-types.js').Priority} Priority
 * @typedef {import('./protocol-types.js').StandingAlarm} Alarm
 * @typedef {import('./protocol-types.js').Message} Message
 */

export const RANK = /** @type {Record<Priority, number>} */ ({ critical: 3, warning: 2, advisory: 1 });
export const ICONS = /** @type {const} */ ({ critical: 'crit', warning: 'warn', advisory: 'info' });

const PLACES = ['dialog', 'snackbar', 'list'];
const SOUNDS = ['high', 'medium', 'low', 'none'];
const STATES = ['NORMAL', 'UNACKED', 'ACKED', 'RTN_UNACKED', 'SHELVED', 'SUPPRESSED', 'OUT_OF_SERVICE'];

/** @param {unknown} name @returns {Priority} */
export function priorityOf(name) {
  return typeof name === 'string' && Object.hasOwn(RANK, name) ? /** @type {Priority} */ (name) : 'critical';
}

/**
 * What has a priority, with one that this page knows; changed in place.
 * @template {{priority: Priority}} One
 * @param {One[]} list
 */
export function ranked(list) {
  for (const one of list) one.priority = priorityOf(one.priority);
  return list;
}

/** Events of alarms as `ranked` has them; those of no alarm have no priority. @template {import('./protocol-types.js').LogEvent} One @param {One[]} events */
export function rankedEvents(events) {
  for (const event of events) if (event.alarm) event.priority = priorityOf(event.priority);
  return events;
}

/** @param {{id: string, title: string, priority: Priority, state: string, sound: string, place?: string, actions?: string[]}} alarm changed in place */
function understand(alarm) {
  const priority = priorityOf(alarm.priority);
  const isForeign = priority !== alarm.priority;
  alarm.priority = priority;
  alarm.title ||= alarm.id;
  if (!STATES.includes(alarm.state)) alarm.state = 'UNACKED';
  if (!SOUNDS.includes(alarm.sound) || (isForeign && alarm.sound !== 'none')) alarm.sound = 'high'; // none: it was silenced
  if ('actions' in alarm) alarm.place = !isForeign && PLACES.includes(alarm.place ?? '') ? alarm.place : 'dialog'; // a summary of a car has none
}

/**
 * A message whose alarms this page knows how to show; changed in place.
 * @template {Message} One
 * @param {One} message
 */
export function understood(message) {
  if (message.kind === 'state') understandState(message);
  else if (message.kind === 'beside') message.state.alarms.forEach(understand);
  else if (message.kind === 'events') rankedEvents(message.events);
  else if (message.kind === 'timeline') ranked(message.marks);
  else if (message.kind === 'cars') {
    for (const { summary } of message.cars) if (summary?.worst) understand(summary.worst);
  }
  return message;
}

/** @param {import('./protocol-types.js').State} state */
function understandState({ alarms, suppressed, live, control }) {
  alarms.forEach(understand);
  ranked(suppressed ?? []);
  live?.alarms?.forEach(understand);
  for (const line of control.handover?.lines ?? []) if (line.kind === 'alarm' && line.priority !== null) line.priority = priorityOf(line.priority);
}
