// Two recordings on one time line: pure functions.

import assert from 'node:assert/strict';
import test from 'node:test';

import { alarmShift, checkWords, clockShift, firstMotion, holesOf, leaderAt, lineByKey, lineTime, missingWords, ordersOf, placeOf, sharing, shiftByKey, shiftWords, unionOf } from '../../static/js/replay/compare-layout.js';

const A = { start_ms: 1_000_000, length_s: 60 };
const B = { start_ms: 1_030_000, length_s: 90 };
const STILL = /** @type {any} */ ({ at_s: 10, length_s: 60, is_playing: false, is_seeking: false, rate: 1 });

test('the time line reaches from the first beginning to the last end', () => {
  assert.deepEqual(unionOf(A, B, 0), [0, 90]);
  assert.deepEqual(unionOf(A, B, 20), [0, 110]);
  assert.deepEqual(unionOf(A, B, -20), [-20, 70]);
  assert.deepEqual(unionOf(A, { ...B, length_s: 5 }, 10), [0, 60]);
});

test('both always share a part of it', () => {
  assert.equal(sharing(500, A, B), 59);
  assert.equal(sharing(-500, A, B), -89);
  assert.equal(sharing(12.345, A, B), 12.35);
  assert.equal(sharing(500, A, { ...B, length_s: 0.4 }), 59.6);
});

test('by the clock only where both were recorded at once', () => {
  assert.equal(clockShift(A, B), 30);
  assert.equal(clockShift(B, A), -30);
  assert.equal(clockShift(A, { ...B, start_ms: 1_060_000 }), null);
  assert.equal(clockShift(A, { start_ms: 990_000, length_s: 10 }), null);
});

test('by the first alarm that both have', () => {
  const mark = (/** @type {string} */ alarm, /** @type {number} */ at_s) => /** @type {any} */ ({ alarm, at_s, title: alarm, priority: 'warning' });
  assert.deepEqual(alarmShift([mark('gps', 3), mark('speed', 20)], [mark('speed', 12), mark('speed', 40)]), { shift_s: 8, title: 'speed' });
  assert.equal(alarmShift([mark('gps', 3)], [mark('speed', 12)]), null);
});

test('the first motion is the first bucket beyond walking pace, backwards too', () => {
  const answer = (/** @type {(number | null)[]} */ lowest, /** @type {(number | null)[]} */ highest) => /** @type {any} */ ({ from_s: 5, step_s: 2, signals: { speed: { lowest, highest } } });
  assert.deepEqual(firstMotion(answer([0, null, 0, 1], [0.5, null, 0.6, 2])), [9, 11]);
  assert.deepEqual(firstMotion(answer([0, -0.7], [0, 0])), [7, 9]);
  assert.equal(firstMotion(answer([0, null], [0.5, null])), null);
  assert.equal(firstMotion(/** @type {any} */ ({ from_s: 0, step_s: 1, signals: {} })), null);
});

test('a side is sought only where it is elsewhere, and played only within its recording', () => {
  assert.deepEqual(ordersOf(STILL, { at_s: 10.01, isPlaying: false, rate: 1 }), []);
  assert.deepEqual(ordersOf(STILL, { at_s: 12, isPlaying: false, rate: 1 }), [{ do: 'seek', at_s: 12 }]);
  assert.deepEqual(ordersOf({ ...STILL, is_seeking: true }, { at_s: 12, isPlaying: false, rate: 1 }), []);
  assert.deepEqual(ordersOf(STILL, { at_s: 12, isPlaying: true, rate: 4 }), [{ do: 'rate', rate: 4 }, { do: 'seek', at_s: 12 }, { do: 'play' }]);
  assert.deepEqual(ordersOf({ ...STILL, is_playing: true }, { at_s: 10.3, isPlaying: true, rate: 1 }), [], 'a frame was under way');
  assert.deepEqual(ordersOf({ ...STILL, is_playing: true }, { at_s: 10.6, isPlaying: true, rate: 1 }), [{ do: 'seek', at_s: 10.6 }]);
  assert.deepEqual(ordersOf(STILL, { at_s: -5, isPlaying: true, rate: 1 }), [{ do: 'seek', at_s: 0 }], 'it waits at its beginning');
  assert.deepEqual(ordersOf({ ...STILL, at_s: 60 }, { at_s: 75, isPlaying: true, rate: 1 }), [], 'played at its end it would begin anew');
  assert.deepEqual(ordersOf({ ...STILL, at_s: 59.8, is_playing: true }, { at_s: 60.1, isPlaying: true, rate: 1 }), [], 'it comes to its end by itself');
  assert.deepEqual(ordersOf({ ...STILL, at_s: 60, is_seeking: true }, { at_s: 50, isPlaying: true, rate: 1 }), [{ do: 'seek', at_s: 50 }, { do: 'play' }], 'played at its end it would begin anew');
  assert.deepEqual(ordersOf({ ...STILL, at_s: 60, is_playing: true }, { at_s: 75, isPlaying: true, rate: 1 }), [{ do: 'pause' }]);
});

test('A leads where it is, B where A is not', () => {
  assert.equal(leaderAt(5, A, B, 20), 'a');
  assert.equal(leaderAt(60, A, B, 20), 'b');
  assert.equal(leaderAt(-5, A, B, -20), 'b');
  assert.equal(leaderAt(110, A, B, 20), null);
});

test('what is missing of a side is named', () => {
  const replay = /** @type {any} */ ({ hangs_s: null, is_seeking: false, silent_s: 0.1, is_settled: true });
  assert.deepEqual(placeOf(5, 20, 90), { kind: 'before', by_s: 15 });
  assert.deepEqual(placeOf(112, 20, 90), { kind: 'after', by_s: 2 });
  assert.deepEqual(placeOf(110, 20, 90), { kind: 'in', by_s: 0 });
  assert.equal(missingWords({ kind: 'before', by_s: 15 }, replay), 'Not begun: it begins 0:15.0 later');
  assert.equal(missingWords({ kind: 'after', by_s: 80.04 }, replay), 'Ended 1:20.0 earlier');
  const inside = /** @type {const} */ ({ kind: 'in', by_s: 0 });
  assert.equal(missingWords(inside, replay), '');
  assert.equal(missingWords(inside, { ...replay, silent_s: 3.24 }), 'Nothing recorded for 3.2 s');
  assert.equal(missingWords(inside, { ...replay, silent_s: null }), 'No message from the car yet');
  assert.equal(missingWords(inside, { ...replay, is_settled: false }), 'Checks still warming up');
});

test('holes are on the time line, and a signal that was never recorded is one', () => {
  const answer = /** @type {any} */ ({ known_s: 60, length_s: 60, is_sketch: false, blind: [[10, 12]], signals: { speed: { gaps: [[30, 31]] } }, offered: { speed: { has_data: true }, brake: { has_data: false } } });
  assert.deepEqual(holesOf(answer, 'speed', 5, 60), [
    { from_s: -Infinity, to_s: 5, why: 'not begun' }, { from_s: 65, to_s: Infinity, why: 'ended' },
    { from_s: 15, to_s: 17, why: 'no data' }, { from_s: 35, to_s: 36, why: 'no data' }]);
  assert.deepEqual(holesOf(answer, 'brake', 5, 60), [{ from_s: -Infinity, to_s: Infinity, why: 'not recorded' }]);
  assert.equal(holesOf({ ...answer, known_s: 20 }, 'brake', 5, 60).at(-1)?.why, 'not read yet');
  assert.equal(holesOf(null, 'speed', 5, 60).length, 2);
});

test('times and the shift as text', () => {
  assert.equal(lineTime(72.34), '1:12.3');
  assert.equal(lineTime(-5), '−0:05.0');
  assert.equal(lineTime(-0.01), '0:00.0');
  assert.equal(lineTime(59.96), '1:00.0');
  assert.equal(shiftWords(0), 'B begins with A');
  assert.equal(shiftWords(12.3), 'B begins 12.3 s after A');
  assert.equal(shiftWords(-0.25), 'B begins 0.25 s before A');
  assert.equal(shiftWords(-75), 'B begins 1:15.0 before A');
  assert.equal(checkWords(/** @type {any} */ ([{ verdict: 'ok' }, { verdict: 'ok' }, { verdict: 'fault' }, { verdict: 'unknown' }])), '2 OK, 1 fault, 1 not checked');
});

test('keys lead along the time line, and move B', () => {
  assert.equal(lineByKey('ArrowRight', 10, [0, 200]), 15);
  assert.equal(lineByKey('ArrowLeft', 1, [-2, 200]), -2);
  assert.equal(lineByKey('.', 10, [0, 200]), 10.1);
  assert.equal(lineByKey('End', 10, [0, 200]), 200);
  assert.equal(lineByKey('x', 10, [0, 200]), null);
  assert.equal(shiftByKey(']'), 0.1);
  assert.equal(shiftByKey('{'), -1);
  assert.equal(shiftByKey('x'), null);
});
