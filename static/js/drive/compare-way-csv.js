// Two drives beside each other as a table (RFC 4180): a row for each place or moment of A. Pure.

import { difference, placeOfB } from './compare-way-model.js';
import { summaryOf } from './compare-way-summary.js';

/**
 * @typedef {import('../core/protocol-types.js').Course} Course
 * @typedef {import('../core/protocol-types.js').CourseEvent} CourseEvent
 * @typedef {import('./compare-way-model.js').By} By
 * @typedef {import('./compare-way-model.js').Point} Point
 * @typedef {import('./compare-way-model.js').Row} Row
 */

const POINT = ['time [UTC]', 'time [s]', 'distance [m]', 'speed [m/s]', 'steering [%]', 'following error [m/s]', 'GPS error [m]', 'latitude [deg]', 'longitude [deg]', 'events'];
const FORMULA = /^\s*[=+\-@|＝＋－＠]/; // a spreadsheet would compute it

/** An empty cell is not known; there B was not, or had no data. The last lines are the summary: what, A, B, B − A, the largest B − A, in words. @param {Row[]} rows @param {By} by @param {Course} a @param {Course} b */
export function csvOf(rows, by, a, b) {
  const ofA = eventsAt(rows, a.events, ({ t, m }) => (by === 'time' ? t : m));
  const ofB = eventsAt(rows, b.events, ({ t }) => placeOfB(rows, t));
  const heads = [by === 'time' ? 'time along A [s]' : 'distance along A [m]', ...POINT.map((head) => `A ${head}`), ...POINT.map((head) => `B ${head}`), 'B aside of A [m]', 'speed, B − A [m/s]', 'steering, B − A [%]'];
  const lines = rows.map((row, i) => [
    number(row.x, 2), ...pointCells(row.a, a), text(ofA.get(i)), ...pointCells(row.b, b), text(ofB.get(i)),
    number(row.aside, 2), number(difference(row, 'speed'), 3), number(difference(row, 'steering'), 2),
  ]);
  const rest = heads.slice(6).map(() => '');
  const summary = [['summary', 'A', 'B', 'B − A', 'largest B − A', 'in words', ...rest], ...summaryOf(rows, by, a, b).map(({ name, unit, a: ofA, b: ofB, mean, most, words }) => (
    [unit ? `${name} [${unit}]` : name, ...[ofA, ofB, mean, most].map((value) => number(value, 3)), words, ...rest]))];
  return [heads, ...lines, ...summary].map((cells) => `${cells.map(quoted).join(',')}\r\n`).join('');
}

/** @param {Point | null} point @param {Course} course */
function pointCells(point, course) {
  if (!point) return POINT.slice(1).map(() => '');
  return [new Date(course.start_ms + point.t * 1000).toISOString(), number(point.t, 2), number(point.m, 2), number(point.speed, 3), number(point.steering, 2), number(point.follow, 3), number(point.gps, 2), number(point.lat, 7), number(point.lon, 7)];
}

/** By the row nearest to each; without those that are not on the axis. @param {Row[]} rows @param {CourseEvent[]} events @param {(event: CourseEvent) => number | null} place */
function eventsAt(rows, events, place) {
  /** @type {Map<number, string>} */
  const found = new Map();
  for (const event of events) {
    const at = place(event);
    if (at === null) continue;
    let best = 0;
    rows.forEach(({ x }, i) => {
      if (Math.abs(x - at) < Math.abs((rows[best]?.x ?? 0) - at)) best = i;
    });
    const entry = event.text ? `${event.kind}: ${event.text}` : event.kind;
    found.set(best, found.has(best) ? `${found.get(best)}; ${entry}` : entry);
  }
  return found;
}

/** @param {number | null} value @param {number} digits */
const number = (value, digits) => (value === null ? '' : String(Number(value.toFixed(digits))));

/** A text that people wrote, so that no spreadsheet takes it for a formula. @param {string | undefined} entered */
const text = (entered) => (entered === undefined ? '' : FORMULA.test(entered) ? `'${entered}` : entered);

/** @param {string} cell */
const quoted = (cell) => (/[",\r\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
