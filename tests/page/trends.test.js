import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Minute, SPAN, SPECS, STEP_S } from '../../static/js/home/trends-layout.js';

const NAMES = SPECS.map(({ name }) => name);

/**
 * Steps from `first` on, all of one signal's numbers in `lowest`.
 * @param {number} first
 * @param {(number | 'none' | null)[]} lowest
 * @param {object} [more]
 * @returns {any}
 */
const steps = (first, lowest, { highest = lowest, now = first + lowest.length + 0.3, since = 0, name = 'speed' } = {}) => ({
  step_s: STEP_S, since, first, now,
  lowest: Object.fromEntries(NAMES.map((one) => [one, one === name ? lowest : lowest.map(() => null)])),
  highest: Object.fromEntries(NAMES.map((one) => [one, one === name ? highest : lowest.map(() => null)])),
});
/** @param {number} from @param {number} count @param {number} [value] */
const steady = (from, count, value = 4) => steps(from, Array(count).fill(value));
/** @param {[number, number][]} gaps */
const rounded = (gaps) => gaps.map((gap) => gap.map((at) => Math.round(at * 10) / 10));

test('what was received is drawn, what was not is a gap and never a line', () => {
  const minute = new Minute();
  minute.take(steady(0, 50));
  minute.take(steps(50, Array(20).fill(null)));
  minute.take(steady(70, 30, 6));
  const course = minute.course('speed', 100, 0.05);
  assert.deepEqual(rounded(course.gaps), [[-60, -20], [-10, -6]]);
  const cut = course.lowest.indexOf(null);
  assert.equal(cut, 50);
  assert.deepEqual([course.lowest[cut - 1], course.lowest[cut + 1]], [4, 6]);
  assert.ok(course.times_s.every((at, i) => i === 0 || at > (course.times_s[i - 1] ?? 0)), 'times ascend');
  assert.deepEqual([course.low, course.high], [4, 6]);
});

test('a page that opens late requests the minute, and what it does not get stays hatched', () => {
  const minute = new Minute();
  minute.take({ ...steady(1000, 4), since: 900 });
  assert.equal(minute.missed, 899);
  assert.deepEqual(rounded(minute.course('speed', 1004, 0.05).gaps), [[-60, -0.8]]);
  minute.take({ ...steady(950, 53), since: 900 }, true);
  assert.equal(minute.missed, null);
  assert.deepEqual(rounded(minute.course('speed', 1004, 0.05).gaps), [[-60, -10.8]]);
});

test('frames that follow each other ask for nothing; a few lost ones neither', () => {
  const minute = new Minute();
  minute.take(steady(0, 4));
  for (let first = 1; first < 40; first += 3) minute.take(steady(first, 4));
  assert.equal(minute.missed, null);
  minute.take(steady(60, 4));
  assert.equal(minute.missed, 39 + 1);
});

test('a radio gap of two minutes leaves nothing of what was before it', () => {
  const minute = new Minute();
  minute.take(steady(0, 300, 9));
  minute.take(steady(900, 4, 1));
  const course = minute.course('speed', 904, 0.05);
  assert.deepEqual([course.low, course.high], [1, 1]);
  assert.deepEqual(rounded(course.gaps), [[-60, -0.8]]);
});

test('silence grows at the right while nothing is received', () => {
  const minute = new Minute();
  minute.take(steady(0, 100));
  assert.deepEqual(rounded(minute.course('speed', 101, 0.05).gaps), [[-60, -20.2]]); // the frame that tells the step under way
  assert.deepEqual(rounded(minute.course('speed', 110, 0.05).gaps), [[-60, -22], [-2, 0]]);
  assert.deepEqual(rounded(minute.course('speed', 1e9, 0.05).gaps), [[-60, 0]]);
});

test('a slow signal has no gaps between its messages, a fast one has', () => {
  const minute = new Minute();
  minute.take(steps(0, Array.from({ length: 300 }, (_, i) => (i % 5 === 0 ? 7 : null))));
  assert.equal(minute.course('speed', 300, 1).gaps.length, 0);
  assert.ok(minute.course('speed', 300, 1).lowest.every((one) => one === 7));
  assert.equal(minute.course('speed', 300, 0.05).gaps.length, 59);
});

test('no object in range is no gap and no line', () => {
  const minute = new Minute();
  minute.take(steps(0, [...Array(140).fill(8), ...Array(20).fill('none'), ...Array(140).fill(9)], { name: 'distance' }));
  const course = minute.course('distance', 300, 0.05);
  assert.deepEqual(course.gaps, []);
  assert.equal(course.lowest.filter((one) => one === null).length, 1);
  assert.ok(course.lowest.every((one) => one === null || one < 10));
});

test('peaks of a fast signal are kept', () => {
  const minute = new Minute();
  minute.take(steps(0, [4, 3.1, 4], { highest: [4, 9.5, 4] }));
  const course = minute.course('speed', 3, 0.05);
  assert.deepEqual([course.low, course.high], [3.1, 9.5]);
});

test('another car, or another run of the server, begins anew', () => {
  const minute = new Minute();
  minute.take(steady(0, 250, 9));
  minute.take({ ...steady(260, 4, 1), since: 258 });
  assert.deepEqual([minute.course('speed', 264, 0.05).low, minute.course('speed', 264, 0.05).high], [1, 1]);
  minute.clear();
  assert.equal(minute.course('speed', 10, 0.05).isEmpty, true);
  minute.take(steady(5, 4, 2)); // the new run's numbers may be lower
  assert.equal(minute.course('speed', 9, 0.05).high, 2);
});

test('an hour takes the room of a minute', () => {
  const minute = new Minute();
  for (let first = 0; first < 18_000; first += 3) minute.take(steady(first, 4));
  const course = minute.course('speed', 18_000, 0.05);
  assert.ok(course.times_s.length <= SPAN);
  assert.deepEqual(course.gaps, []);
});

test('frames that make no sense do no harm', () => {
  const minute = new Minute();
  minute.take({ step_s: 0.2, since: 0, first: 5, now: 6, lowest: {}, highest: {} });
  minute.take(/** @type {any} */ ({ step_s: 0.2, since: 0, first: 5, now: 9, lowest: { speed: [true, 'x', {}, 3] }, highest: { speed: [] } }));
  assert.equal(minute.course('speed', 9, 0.05).low, 3);
});

test('scales are round, hold what is shown, and keep zero', () => {
  const ends = (/** @type {string} */ name, /** @type {number} */ low, /** @type {number} */ high, limits = {}) => SPECS.find((one) => one.name === name)?.ends(limits, low, high);
  assert.deepEqual(ends('speed', 0, 4), [0, 15]);
  assert.deepEqual(ends('speed', -1.4, 4, { 'gauge.speed_max_mps': 10, 'speed_limit.max_mps': 11 }), [-2, 11]);
  assert.deepEqual(ends('distance', 3, 70, { 'obstacle.standoff_m': 5 }), [0, 80]);
  assert.deepEqual(ends('distance', 3, 7, { 'obstacle.standoff_m': 5 }), [0, 20]);
  assert.deepEqual(ends('steering', -4, 3), [-20, 20]);
  assert.deepEqual(ends('acceleration', -4.5, 1), [-4.5, 4.5]);
  assert.deepEqual(ends('brake', 0, 42), [0, 100]);
});
