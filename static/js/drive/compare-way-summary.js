// What changed between two drives, in words and numbers: did the change help? Pure.

import { difference, placeOfB } from './compare-way-model.js';
import { fixed, signed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Course} Course
 * @typedef {import('../core/protocol-types.js').CourseEvent} CourseEvent
 * @typedef {import('./compare-way-model.js').By} By
 * @typedef {import('./compare-way-model.js').Row} Row
 * @typedef {import('./compare-way-model.js').Point} Point
 * @typedef {{name: string, unit: string, a: number | null, b: number | null, mean: number | null, most: number | null, words: string}} Line mean and most: of B − A
 */

/** Where both drove alone: what happened elsewhere is no evidence of the change. @param {Row[]} rows @param {By} by @param {Course} a @param {Course} b @returns {Line[]} */
export function summaryOf(rows, by, a, b) {
  const both = rows.filter((row) => row.b);
  return [
    counts('Interventions', rows, by, a, b, interventionsOf),
    counts('Alarms', rows, by, a, b, alarmsOf),
    numbers('Speed', 'm/s', both, ({ speed }) => (speed === null ? null : Math.abs(speed)), (row) => difference(row, 'speed')),
    numbers('Steering', '%', both, ({ steering }) => steering, (row) => difference(row, 'steering')),
    errors('Following error', 'm/s', both, ({ follow }) => (follow === null ? null : Math.abs(follow))),
    errors('GPS error', 'm', both, ({ gps }) => gps),
    aside(both),
  ];
}

/** Null: they were not recorded, or are more than a course has. @param {Course} course */
export function alarmsOf({ events, are_alarms_known, are_events_cut }) {
  return are_alarms_known && !are_events_cut ? events.filter(({ kind }) => kind !== 'intervention' && kind !== 'mark') : null;
}

/** The same. @param {Course} course */
export function interventionsOf({ events, are_interventions_known, are_events_cut }) {
  return are_interventions_known && !are_events_cut ? events.filter(({ kind }) => kind === 'intervention') : null;
}

/** @param {string} name @param {Row[]} rows @param {By} by @param {Course} a @param {Course} b @param {(course: Course) => CourseEvent[] | null} eventsOf @returns {Line} */
function counts(name, rows, by, a, b, eventsOf) {
  const isMet = (/** @type {number | null} */ x) => x !== null && nearest(rows, x)?.b != null;
  const ofA = eventsOf(a)?.filter((event) => isMet(by === 'time' ? event.t : event.m)).length ?? null;
  const ofB = eventsOf(b)?.filter((event) => placeOfB(rows, event.t) !== null).length ?? null;
  if (ofA === null || ofB === null) {
    const side = ofB !== null ? ' in A' : ofA !== null ? ' in B' : '';
    return { name, unit: '', a: ofA, b: ofB, mean: null, most: null, words: `not known${side}` };
  }
  const words = ofA === ofB ? 'as many in both' : `${Math.abs(ofB - ofA)} ${ofB < ofA ? 'fewer' : 'more'} in B`;
  return { name, unit: '', a: ofA, b: ofB, mean: ofB - ofA, most: null, words };
}

/** @param {Row[]} rows @param {number} x */
function nearest(rows, x) {
  /** @type {Row | null} */
  let best = null;
  for (const row of rows) if (!best || Math.abs(row.x - x) < Math.abs(best.x - x)) best = row;
  return best;
}

/** Means of both, and of B − A. @param {string} name @param {string} unit @param {Row[]} both @param {(point: Point) => number | null} of @param {(row: Row) => number | null} delta @returns {Line} */
function numbers(name, unit, both, of, delta) {
  const deltas = known(both.map(delta));
  const [mean, most] = [meanOf(deltas), mostOf(deltas)];
  const words = mean === null || most === null ? 'not known in both' : `B − A: mean ${signed(mean)}, largest ${signed(most)} ${unit}`;
  return { name, unit, a: meanOf(known(both.map((row) => of(row.a)))), b: meanOf(known(both.map((row) => row.b && of(row.b)))), mean, most, words };
}

/** The smaller is the better. @param {string} name @param {string} unit @param {Row[]} both @param {(point: Point) => number | null} of @returns {Line} */
function errors(name, unit, both, of) {
  const [ofA, ofB] = [known(both.map((row) => of(row.a))), known(both.map((row) => row.b && of(row.b)))];
  const [a, b] = [meanOf(ofA), meanOf(ofB)];
  const deltas = known(both.map((row) => {
    const [one, other] = [of(row.a), row.b && of(row.b)];
    return one === null || other === null ? null : other - one;
  }));
  const line = { name, unit, a, b, mean: meanOf(deltas), most: mostOf(deltas) };
  if (a === null || b === null) return { ...line, words: 'not known in both' };
  const verdict = Math.abs(b - a) < 0.005 ? 'the same in both' : `${b < a ? 'smaller' : 'larger'} in B by ${fixed(Math.abs(b - a), 2)} ${unit}`;
  return { ...line, words: `${verdict}; largest A ${fixed(Math.max(...ofA), 2)}, B ${fixed(Math.max(...ofB), 2)}` };
}

/** How far B drove beside A. @param {Row[]} both @returns {Line} */
function aside(both) {
  const all = known(both.map((row) => row.aside));
  const [mean, most] = [meanOf(all), mostOf(all)];
  return { name: 'Aside', unit: 'm', a: null, b: null, mean, most, words: mean === null || most === null ? 'not known' : `B from A: mean ${fixed(mean)}, largest ${fixed(most)} m` };
}

/** @param {(number | null)[]} values @returns {number[]} */
const known = (values) => values.filter((value) => value !== null);

/** @param {number[]} values */
const meanOf = (values) => (values.length ? values.reduce((sum, one) => sum + one, 0) / values.length : null);

/** The one that is farthest from 0. @param {number[]} values */
const mostOf = (values) => (values.length ? values.reduce((most, one) => (Math.abs(one) > Math.abs(most) ? one : most)) : null);
