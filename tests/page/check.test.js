import assert from 'node:assert/strict';
import { test } from 'node:test';
import { endsOf, episodeWords, episodesOf, figuresOf, gapsOf, meantOf, placeOf, thresholdWords, totalWords } from '../../static/js/alarms/check-layout.js';
import { countWords, markAt } from '../../static/js/alarms/checks.js';
import { alarm } from './frames.js';

const quantity = (/** @type {number} */ value, label = 'Speed', unit = 'm/s') => ({ label, value, unit });
/** @param {any} more @returns {any} */
const answer = (more) => ({ verdict: 'ok', text: '', for_s: 41, measured: quantity(4.2), limit: quantity(11, 'Limit'), ...more });
const read = (/** @type {any} */ one, /** @type {any} */ standing = null, isKnown = true) => figuresOf(one, standing, isKnown).map(({ label, value, unit }) => `${label} ${value} ${unit}`.trim());

test('three numbers; what is not known is a dash', () => {
  assert.deepEqual(read(answer({})), ['Speed 4.2 m/s', 'Limit 11.0 m/s', 'OK for 41.0 s']);
  assert.deepEqual(read(answer({ verdict: 'fault', measured: quantity(12.6), for_s: 2.3 })), ['Speed 12.6 m/s', 'Limit 11.0 m/s', 'Above for 2.3 s']);
  assert.deepEqual(read(answer({ verdict: 'fault', measured: quantity(3, 'Gap', 'm'), limit: quantity(5, 'Least', 'm') })), ['Gap 3.0 m', 'Least 5.0 m', 'Below for 41.0 s']);
  assert.deepEqual(read(answer({ verdict: 'unknown', measured: null, limit: null, for_s: 75 })), ['Measured –', 'Limit –', 'Not checked for 1:15']);
  assert.deepEqual(read(answer({}), null, false), ['Speed –', 'Limit –', 'Not checked for –'], 'nothing live');
  assert.deepEqual(read(null), ['Measured –', 'Limit –', 'Not checked for –']);
});

test('the line of the thresholds shows when the alarm begins, and at what value it ends', () => {
  const delays = { on_s: 0.3, off_s: 2 };
  assert.equal(thresholdWords({ delays, ends: { side: 'below', value: 10.5, unit: 'm/s' } }), 'alarm after 0.3 s, ends below 10.5 m/s after 2 s');
  assert.equal(thresholdWords({ delays, ends: { side: 'above', value: 20, unit: '%' } }), 'alarm after 0.3 s, ends above 20.0 % after 2 s');
  assert.equal(thresholdWords({ delays, ends: null }), 'alarm after 0.3 s, ends after 2 s');
});

test('an alarm that stands tells its own numbers, ten times a second', () => {
  const standing = alarm({ verdict: 'fault', measured: quantity(12.8), limit: quantity(11, 'Limit'), for_s: 2.4 });
  assert.deepEqual(read(answer({ verdict: 'ok' }), standing), ['Speed 12.8 m/s', 'Limit 11.0 m/s', 'Above for 2.4 s']);
});

const event = (/** @type {number} */ n, /** @type {string} */ change, /** @type {number} */ at_s, more = {}) => /** @type {any} */ ({ n, change, at_ms: at_s * 1000, alarm: 'a', occurrence: 1, by: null, worst: null, ...more });
const worst = (/** @type {number} */ value, side = 'above') => ({ worst: { ...quantity(value), side } });

test('the alarms of a drive, newest first: when, how long, the worst, who answered and how soon', () => {
  const found = episodesOf([
    event(9, 'raised', 100, worst(12.6)), event(4, 'cleared', 29, worst(11.9)), event(2, 'raised', 20, worst(11.2)), event(3, 'acknowledged', 21.1, { by: 'Desk 1', ...worst(11.9) }),
  ]);
  assert.deepEqual(found.map((one) => episodeWords(one, 102_300)).map(({ text, lasted }) => [text, lasted]), [['active, highest 12.6 m/s', '2.3 s'], ['highest 11.9 m/s, acknowledged by Desk 1 after 1.1 s', '9.0 s']]);
  assert.equal(totalWords(found, 102_300), '2 times, 11.3 s in all');
  assert.equal(totalWords([], 0), 'no alarm');
});

test('what was raised before the first event that is known is left out; an answer after the end still counts', () => {
  const found = episodesOf([event(1, 'cleared', 5), event(2, 'raised', 10, worst(3, 'below')), event(3, 'cleared', 12), event(4, 'acknowledged', 15, { by: 'Ann' })]);
  assert.deepEqual(found.map((one) => episodeWords(one, 0).text), ['lowest 3.0 m/s, acknowledged by Ann after 5.0 s']);
  const unanswered = episodesOf([event(2, 'raised', 10), event(3, 'cleared', 12)]);
  assert.equal(episodeWords(/** @type {any} */ (unanswered[0]), 0).text, 'not acknowledged');
});

test('an answer counts from the newest announcement, the first answer stays', () => {
  const found = episodesOf([event(1, 'raised', 0), event(2, 'recaused', 8), event(3, 'acknowledged', 10, { by: 'Ann' }), event(4, 'acknowledged', 11, { by: 'Ben' })]);
  assert.deepEqual([found.length, found[0]?.by, found[0]?.took_s], [1, 'Ann', 2]);
});

test('the pager knows its tile', () => {
  const tiles = [{ label: 'Speed', ids: ['speed_limit'] }, { label: 'GPS', ids: ['gps_drift', 'gps_jump'] }];
  assert.deepEqual(placeOf(tiles, 'gps_jump'), { at: 1, before: tiles[0], after: null, of: 2 });
  assert.deepEqual(placeOf(tiles, 'unknown'), { at: -1, before: null, after: null, of: 2 });
});

test('a press on a tile opens the check that made it so', () => {
  const checks = /** @type {any[]} */ ([{ id: 'a', verdict: 'ok' }, { id: 'b', verdict: 'unknown' }, { id: 'c', verdict: 'fault' }]);
  assert.equal(meantOf(checks, 'fault'), 'c');
  assert.equal(meantOf(checks.slice(0, 2), 'fault'), 'b', 'the worst there is');
  assert.equal(meantOf([], 'ok'), null);
});

test('the scale holds zero, all values and the limit', () => {
  for (const [values, limits] of /** @type {[(number | null)[], (number | null)[]][]} */ ([[[5, 12.6, null], [11]], [[-3, 1], []], [[0.2], [2]], [[null], [null]], [[0], []]])) {
    const [low, high] = endsOf(values, limits);
    assert.ok(low < high);
    for (const value of [0, ...values, ...limits]) if (value !== null) assert.ok(low <= value && value <= high, `${value} in ${low} … ${high}`);
  }
  assert.deepEqual(endsOf([5, 12.6], [11]), [0, 15]);
});

test('what was not checked is hatched', () => {
  assert.deepEqual(gapsOf([null, null, 1, null, 2, null]), [[0, 2], [3, 4], [5, 6]]);
  assert.deepEqual(gapsOf([1, 2]), []);
});

test('a finger on the marks means the nearest that is not OK', () => {
  const kinds = ['ok', 'ok', 'ok', 'unk', 'ok', 'ok', 'ok', 'ok'];
  const at = (/** @type {number} */ i, width = 15) => markAt((i + 0.5) * width, kinds, width);
  assert.deepEqual([at(3), at(2), at(4), at(5), at(0), at(7)], [3, 3, 3, 5, 0, 7]);
  assert.equal(at(2, 30), 2, 'a wide mark means itself');
  assert.equal(markAt(150 + 3, ['ok', 'ok', 'ok', 'ok', 'unk', 'ok'], 30), 4, 'near its edge');
  assert.equal(markAt(999, kinds, 15), 7);
});

test('how many are OK', () => {
  const shown = (/** @type {any[]} */ ...kinds) => countWords(kinds.map((kind) => ({ label: '', kind, icon: '', lines: [] })));
  assert.equal(shown('ok', 'ok', 'unk', 'crit', 'warn'), '2 OK · 2 faults · 1 not checked');
  assert.equal(shown('ok'), '1 OK');
});
