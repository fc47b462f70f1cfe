import assert from 'node:assert/strict';
import { test } from 'node:test';

import { alarmWords, modeWords, startedWords } from '../../static/js/drive/mode-text.js';
import { pathOf, topOf, xOf } from '../../static/js/drive/take-over-plot.js';

/** @param {object} [more] */
const mode = (more = {}) => /** @type {any} */ ({ mode: 'autonomous', why: null, since_ms: 1_000_000, way_m: 1190, source: '/m', open: [], ...more });
/** @param {object} [more] */
const intervention = (more = {}) => /** @type {any} */ ({ kind_of: 'to_manual', initiated_by: 'driver', brake_percent: 45.9, acted_before_s: 0.18, active: [], last_alarm_ago_s: 64, ...more });

test('the mode with its time and way; what is not known has a reason and never a mode', () => {
  assert.deepEqual(modeWords(mode(), 1_212_000, true), { mode: 'autonomous', title: 'Autonomous', text: '03:32 · 1.19 km', open: null });
  assert.equal(modeWords(mode({ mode: 'manual', way_m: 14.2 }), 1_006_000, true).text, '00:06 · 14 m');
  assert.equal(modeWords(mode({ since_ms: null, way_m: null }), 0, true).text, '');
  assert.deepEqual(modeWords(mode({ mode: 'unknown', why: 'no_source' }), 0, true), { mode: 'unknown', title: 'Mode not known', text: 'no mode topic', open: null });
  for (const why of ['silent', 'flickers', 'unclear']) assert.ok(modeWords(mode({ mode: 'unknown', why }), 0, true).text);
  assert.equal(modeWords(mode(), 0, false).mode, 'unknown', 'without a link the last mode is old');
  assert.equal(modeWords(null, 0, true).text, 'no link to the car');
});

test('what waits for its description is shown, the oldest first', () => {
  const open = [{ id: 'i-1', at_ms: 1, kind_of: 'brake' }, { id: 'i-2', at_ms: 2, kind_of: 'to_manual' }];
  assert.deepEqual(modeWords(mode({ open: open.slice(0, 1) }), 0, true).text, 'Describe braking');
  const two = modeWords(mode({ open }), 0, true);
  assert.deepEqual([two.text, two.open], ['2 to describe', 'i-1']);
  assert.equal(modeWords(mode({ open: [{ id: 'i-3', at_ms: 3, kind_of: 'of a newer server' }] }), 0, true).text, 'Describe');
});

test('who acted first, and the alarms then, as text', () => {
  assert.deepEqual(startedWords(intervention()), { title: 'By the driver', value: '46', unit: '% brake', text: '0.2 s before mode' });
  assert.equal(startedWords(intervention({ brake_percent: null, acted_before_s: null, initiated_by: 'unknown' })).value, 'not known');
  assert.deepEqual(alarmWords(intervention()), { value: '0', text: 'last 64 s ago' });
  assert.deepEqual(alarmWords(intervention({ active: ['Obstacle'] })), { value: '1', text: 'Obstacle' });
  assert.equal(alarmWords(intervention({ last_alarm_ago_s: null })).text, 'none before');
});

test('the curve begins anew after a gap and stays within its frame', () => {
  const at = (/** @type {number} */ at_s, /** @type {number | null} */ speed_mps) => ({ at_s, speed_mps, brake_percent: null });
  const path = pathOf([at(-12, 5), at(-10, 5), at(-9.5, 5), at(-9, null), at(-5, 5), at(6, 99), at(7, 5)], ({ speed_mps }) => speed_mps, 10);
  assert.equal(path.match(/M/g)?.length, 3);
  assert.equal(path.match(/[ML]/g)?.length, 4);
  assert.deepEqual([xOf(-10), xOf(6)], [34, 328]);
  assert.deepEqual([topOf(9.3), topOf(0.2), topOf(2.2), topOf(48)], [10, 1, 3, 60]);
});
