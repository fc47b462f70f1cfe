// The questions to the operator in control: pure functions of the newest frame.

import { counted } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Question} Question
 * @typedef {import('../core/protocol-types.js').Option} Option
 * @typedef {import('../core/protocol-types.js').ControlState} ControlState
 * @typedef {{topics?: Record<string, string>, units?: Record<string, string>}} Choices signal → topic, or name of its unit
 */

/**
 * Who answers: this page, or another one.
 * @param {{isViewer: boolean, page: string, control: ControlState | null, replaying?: boolean}} seen
 * @returns {boolean} where nobody is in control, the first to act is; a replay is of this page alone
 */
export function mayAnswer({ isViewer, page, control, replaying = false }) {
  if (isViewer) return false;
  if (replaying) return true;
  if (!control) return false;
  return control.holder === null || (page !== '' && control.page === page);
}

/**
 * The subject of a question: a car, or a recording of it, whose questions are others.
 * @param {{vehicle: string, frame?: {replay?: {id: string}} | null}} store
 */
export function placeOf({ vehicle, frame }) {
  return frame?.replay ? `${vehicle} ${frame.replay.id}` : vehicle;
}

/**
 * A question of a car keeps its key when options come and go: what was put off once is not shown again.
 * @param {string} vehicle
 * @param {Question} question
 */
export function keyOf(vehicle, { signal, kind }) {
  return JSON.stringify([vehicle, signal, kind]);
}

/**
 * The questions with a card, and those that were put off.
 * @param {string} vehicle
 * @param {Question[]} questions that stand, the most urgent first
 * @param {ReadonlySet<string>} later keys of those put off
 */
export function dealt(vehicle, questions, later) {
  const isLater = (/** @type {Question} */ one) => later.has(keyOf(vehicle, one));
  return { open: questions.filter((one) => !isLater(one)), waiting: questions.filter(isLater) };
}

/** The change of settings that answers. @param {Question} question @param {string} value of an option @returns {Choices} */
export function answerOf({ signal, kind }, value) {
  return kind === 'source' ? { topics: { [signal]: value } } : { units: { [signal]: value } };
}

/**
 * What holds while nobody has answered.
 * @param {Question} question
 * @param {string} label of its signal
 */
export function meanwhileWords({ kind }, label) {
  const name = /^[A-Z][a-z]/.test(label) ? label.charAt(0).toLowerCase() + label.slice(1) : label; // GPS remains GPS
  return `The ${name} is not used until ${kind === 'source' ? 'one is chosen' : 'its unit is known'}.`;
}

/**
 * The line that stays of what was put off: "Not chosen: Laser, unit of Brake".
 * @param {Question[]} waiting
 * @param {(signal: string) => string} label
 */
export function waitingWords(waiting, label) {
  const names = waiting.map(({ signal, kind }) => (kind === 'source' ? label(signal) : `unit of ${label(signal)}`));
  return `Not chosen: ${names.slice(0, 3).join(', ')}${names.length > 3 ? ` and ${names.length - 3} more` : ''}`;
}

/** What of the options is not listed; '': nothing. @param {Question} question */
export function restWords({ options, options_count }) {
  const more = options_count - options.length;
  return more > 0 ? `${counted(options_count, 'candidate')} in all; the ${options.length} most probable are listed.` : '';
}
