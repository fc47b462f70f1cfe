import assert from 'node:assert/strict';
import { test } from 'node:test';
import { countWords, noneWords, rowsOf } from '../../static/js/alarms/alarms-layout.js';

/** @param {string} id @param {any} [more] @returns {any} */
const alarm = (id, more) => ({
  id, occurrence: 1, title: id, priority: 'warning', state: 'UNACKED', active: true, raised_ms: 0, text: 'now', trip_text: 'then', actions: [], shelved_until_ms: null, ...more,
});
const shown = (/** @type {any[]} */ alarms, /** @type {any[]} */ suppressed = [], mayAct = true) => rowsOf(alarms, suppressed, mayAct);

test('what waits comes first, of it what still stands; then danger, then the newest', () => {
  const rows = shown([
    alarm('shelved', { state: 'SHELVED', raised_ms: 9 }), alarm('known', { state: 'ACKED', priority: 'critical' }), alarm('ended', { state: 'RTN_UNACKED', active: false, priority: 'critical' }),
    alarm('old', { raised_ms: 1 }), alarm('new', { raised_ms: 2 }), alarm('worst', { priority: 'critical' }),
  ], [{ id: 'hidden', title: 'hidden', priority: 'critical', by: ['worst'], raised_ms: null }]);
  assert.deepEqual(rows.map(({ title }) => title), ['worst', 'new', 'old', 'ended', 'known', 'shelved', 'hidden']);
  assert.equal(countWords(rows), '4 unacknowledged');
  assert.equal(rows.at(-1)?.words, 'cause: worst');
});

test('whatever is unacknowledged can be acknowledged, also once it has returned', () => {
  const keys = (/** @type {any} */ more) => shown([alarm('a', { actions: ['shelve', 'acknowledge'], ...more })])[0]?.keys;
  assert.deepEqual(keys({}), ['shelve', 'acknowledge']);
  assert.deepEqual(keys({ actions: ['reconnect'], state: 'RTN_UNACKED', active: false }), ['acknowledge']);
  assert.deepEqual(keys({ state: 'ACKED' }), ['shelve']);
  assert.deepEqual(keys({ state: 'SHELVED' }), ['unshelve']);
  assert.deepEqual(shown([alarm('a')], [], false)[0]?.keys, []);
});

test('states are said in the words of ISA-18.2', () => {
  const state = (/** @type {any} */ more) => shown([alarm('a', more)])[0]?.state;
  assert.equal(state({}), 'unacknowledged');
  assert.equal(state({ state: 'RTN_UNACKED', active: false }), 'returned unacknowledged');
  assert.equal(state({ state: 'ACKED', acknowledged_by: 'Ann' }), 'acknowledged by Ann');
  assert.match(state({ state: 'SHELVED', shelved_by: 'Ann', shelved_until_ms: 0 }) ?? '', /^shelved until \d\d:\d\d:\d\d by Ann$/);
});

test('what is shelved or suppressed is not called acknowledged', () => {
  assert.equal(countWords(shown([alarm('known', { state: 'ACKED' })])), 'all acknowledged');
  assert.equal(countWords(shown([alarm('known', { state: 'ACKED' }), alarm('shelved', { state: 'SHELVED' })])), 'none to acknowledge');
  assert.equal(countWords([]), '');
});

test('an empty list says "no alarms" only where alarms could have come', () => {
  const usual = { isSilent: false, isReplay: false, isPaused: false, isChecked: true };
  const words = (/** @type {Partial<typeof usual>} */ more) => noneWords({ ...usual, ...more });
  assert.equal(words({}), 'No alarms.');
  assert.equal(words({ isReplay: true }), 'No alarms at this moment of the recording.');
  for (const more of [{ isSilent: true }, { isPaused: true }, { isPaused: true, isReplay: true }, { isChecked: false }, { isChecked: false, isReplay: true }]) {
    assert.doesNotMatch(words(more), /^No alarms/);
  }
});
