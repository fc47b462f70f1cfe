// Two drives along the way, and the axes of the logbook: pure functions.

import assert from 'node:assert/strict';
import test from 'node:test';

import { csvOf } from '../../static/js/drive/compare-way-csv.js';
import { aligned, apart, difference, differences, placeOfB } from '../../static/js/drive/compare-way-model.js';
import { summaryOf } from '../../static/js/drive/compare-way-summary.js';
import { ticksTo } from '../../static/js/drive/logbook-plots.js';

const METRE = 1 / 111_319.49;

/**
 * A drive due east at one speed, a point each 2 m.
 * @param {object} [how]
 * @param {number} [how.points]
 * @param {number} [how.speed]
 * @param {number} [how.from_m] where it begins on the way
 * @param {number} [how.aside_m]
 * @param {[number, number]} [how.lost] points without data
 * @param {boolean} [how.hasPlaces]
 */
function course({ points = 100, speed = 10, from_m = 0, aside_m = 0, lost = [-1, -1], hasPlaces = true } = {}) {
  const all = Array.from({ length: points }, (_, i) => i);
  const isLost = (/** @type {number} */ i) => i >= lost[0] && i < lost[1];
  const way = {
    t: all.map((i) => (2 * i) / speed), m: all.map((i) => 2 * i), speed: all.map((i) => (isLost(i) ? null : speed)), steering: all.map((i) => (isLost(i) ? null : 0)),
    lat: all.map((i) => (isLost(i) || !hasPlaces ? null : aside_m * METRE)), lon: all.map((i) => (isLost(i) || !hasPlaces ? null : (from_m + 2 * i) * METRE)),
  };
  return /** @type {import('../../static/js/core/protocol-types.js').Course} */ ({ start_ms: 0, length_s: (2 * points) / speed, length_m: 2 * points, step_m: 2, step_s: 2 / speed, way, time: way, events: [], are_interventions_known: true, are_alarms_known: true, are_events_cut: false, limit_mps: null });
}

test('each place of A is compared with the nearest of B, wherever B began', () => {
  const rows = aligned(course(), course({ speed: 8, from_m: 40, aside_m: 3 }), 'way');
  const row = rows[50]; // 100 m along A, 60 m along B
  assert.equal(row?.b?.m, 60);
  assert.ok(Math.abs((row?.aside ?? 0) - 3) < 0.01);
  assert.equal(row && difference(row, 'speed'), -2);
  assert.equal(rows[0]?.b, null); // B began 40 m farther: it was never here
  assert.ok(Math.abs((placeOfB(rows, 60 / 8) ?? 0) - 100) <= 2);
});

test('without places by the same distance', () => {
  const rows = aligned(course({ hasPlaces: false }), course({ hasPlaces: false, speed: 5 }), 'way');
  assert.equal(rows[50]?.b?.m, 100);
  assert.equal(rows[50]?.aside, null);
});

test('where B has no data nothing is compared', () => {
  const rows = aligned(course(), course({ lost: [40, 60], speed: 9 }), 'way');
  assert.equal(rows[50]?.b, null);
  assert.equal(rows[50] && difference(rows[50], 'speed'), null);
  assert.ok(rows[30]?.b && rows[70]?.b);
});

test('another way is not the same', () => {
  assert.ok(aligned(course(), course({ aside_m: 80 }), 'way').every(({ b }) => b === null));
});

test('by time', () => {
  const rows = aligned(course(), course({ speed: 5 }), 'time');
  assert.equal(rows[10]?.a.m, 20);
  assert.equal(rows[10]?.b?.m, 10);
});

test('where they differ most', () => {
  const [a, b] = [course({ points: 300 }), course({ points: 300 })];
  for (let i = 140; i < 160; i += 1) b.way.speed[i] = 4;
  assert.deepEqual(differences(aligned(a, b, 'way')), [{ x: 280, text: 'B slower', value: '6.0 m/s' }]);
});

test('metres between two places', () => {
  const at = { t: 0, m: 0, speed: 0, steering: 0, follow: null, gps: null, lat: 48, lon: 11 };
  assert.ok(Math.abs((apart(at, { ...at, lat: 48.001 }) ?? 0) - 111.19) < 0.1);
  assert.equal(apart(at, { ...at, lat: null }), null);
});

test('round numbers on an axis', () => {
  assert.deepEqual(ticksTo(8.6), [0, 5, 10]);
  assert.deepEqual(ticksTo(46), [0, 20, 40, 60]);
  assert.deepEqual(ticksTo(0.9, 1), [0, 1]);
});

test('the table has a row for each place of A, and no cell is a formula', () => {
  const a = course({ points: 12 });
  const b = { ...course({ points: 12, speed: 8, lost: [2, 11] }), start_ms: 1000 };
  a.events = [{ t: 0.21, m: 2.1, kind: 'mark', text: 'a "b", c\nd' }, { t: 0.6, m: 6, kind: 'intervention', text: '' }];
  b.events = [{ t: 0, m: 0, kind: '=1+1', text: 'x' }];
  const rows = aligned(a, b, 'way');
  const lines = csvOf(rows, 'way', a, b).split('\r\n');
  assert.equal(lines.length, 14 + 8); // the summary: a head and seven lines
  assert.equal(lines[0]?.split(',').length, 26); // two heads have a comma
  assert.equal(lines[1], "0,1970-01-01T00:00:00.000Z,0,0,10,0,,,0,0,,1970-01-01T00:00:01.000Z,0,0,8,0,,,0,0,'=1+1: x,0,-2,0");
  assert.equal(lines[2], '2,1970-01-01T00:00:00.200Z,0.2,2,10,0,,,0,0.000018,"mark: a ""b"", c\nd",1970-01-01T00:00:01.250Z,0.25,2,8,0,,,0,0.000018,,0,-2,0');
  assert.match(lines[4] ?? '', /^6,.*,intervention,1970/);
  assert.match(lines[9] ?? '', /^16,[^B]*,,,,,,,,,,,,$/); // B sent nothing
});

test('did the change help: what happened, means and largest differences, where both drove', () => {
  const [a, b] = [course(), course({ lost: [50, 100] })];
  for (const [one, follow] of /** @type {[typeof a, number][]} */ ([[a, -0.5], [b, 0.2]])) {
    one.way.follow = one.way.t.map(() => follow);
    one.way.gps = one.way.t.map((_, i) => (one === a ? 0.4 : i === 10 ? 2 : 0.6));
  }
  for (let i = 20; i < 30; i += 1) b.way.speed[i] = 6;
  const at = (/** @type {number} */ i, /** @type {string} */ kind) => ({ t: a.way.t[i] ?? 0, m: 2 * i, kind, text: '' });
  a.events = [at(10, 'intervention'), at(20, 'critical'), at(80, 'intervention'), at(80, 'warning'), at(15, 'mark')];
  b.events = [at(30, 'warning'), at(31, 'advisory')];
  const lines = Object.fromEntries(summaryOf(aligned(a, b, 'way'), 'way', a, b).map(({ name, ...line }) => [name, line]));
  assert.deepEqual(lines['Interventions'], { unit: '', a: 1, b: 0, mean: -1, most: null, words: '1 fewer in B' }); // the other was where B sent nothing
  assert.deepEqual([lines['Alarms']?.a, lines['Alarms']?.b, lines['Alarms']?.words], [1, 2, '1 more in B']);
  assert.equal(lines['Speed']?.words, 'B − A: mean −0.8, largest −4.0 m/s');
  assert.equal(lines['Following error']?.words, 'smaller in B by 0.30 m/s; largest A 0.50, B 0.20');
  assert.match(lines['GPS error']?.words ?? '', /^larger in B by 0\.2\d m; largest A 0\.40, B 2\.00$/);
  assert.equal(lines['Steering']?.words, 'B − A: mean 0.0, largest 0.0 %');
  const none = summaryOf(aligned(course(), course(), 'way'), 'way', course(), course());
  assert.deepEqual(none.filter(({ name }) => / error/.test(name)).map(({ words }) => words), ['not known in both', 'not known in both']);
  assert.equal(none[0]?.words, 'as many in both');
});

test('what a drive did not record is no count, nor one of the better', () => {
  const [a, b] = [course(), course()];
  a.events = [5, 6, 7].map((i) => ({ t: a.way.t[i] ?? 0, m: 2 * i, kind: 'intervention', text: '' }));
  const lines = (/** @type {Partial<typeof a>} */ ofA, /** @type {Partial<typeof b>} */ ofB) => (
    summaryOf(aligned(a, b, 'way'), 'way', { ...a, ...ofA }, { ...b, ...ofB }).slice(0, 2).map((line) => [line.a, line.b, line.mean, line.words]));
  assert.deepEqual(lines({}, {}), [[3, 0, -3, '3 fewer in B'], [0, 0, 0, 'as many in both']]);
  assert.deepEqual(lines({}, { are_interventions_known: false }), [[3, null, null, 'not known in B'], [0, 0, 0, 'as many in both']]);
  assert.deepEqual(lines({ are_alarms_known: false }, { are_alarms_known: false }), [[3, 0, -3, '3 fewer in B'], [null, null, null, 'not known']]);
  assert.deepEqual(lines({ are_events_cut: true }, {}), [[null, 0, null, 'not known in A'], [null, 0, null, 'not known in A']]);
  const { are_alarms_known: _, are_interventions_known: __, ...older } = b; // of a server that did not say so
  assert.deepEqual(summaryOf(aligned(a, b, 'way'), 'way', a, /** @type {any} */ (older))[0]?.words, 'not known in B');
});
