import assert from 'node:assert/strict';
import { test } from 'node:test';
import { standingWords } from '../../static/js/alarms/standing.js';
import { latelyWords, noneWords, pagesOf, together } from '../../static/js/alarms/alarm-pages.js';
import { countWords, rowsOf, silentWords } from '../../static/js/alarms/alarms-layout.js';

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
  assert.equal(rows.at(-1)?.detail, 'cause: worst');
});

test('whatever is unacknowledged can be acknowledged, also once it has returned; what sounds can be silenced', () => {
  const keys = (/** @type {any} */ more) => shown([alarm('a', { actions: ['shelve', 'acknowledge'], ...more })])[0]?.keys;
  assert.deepEqual(keys({ sound: 'high' }), ['silence', 'acknowledge']);
  assert.deepEqual(keys({ sound: 'high', silenced_until_ms: 1 }), ['acknowledge']);
  assert.deepEqual(keys({ sound: 'none' }), ['acknowledge']);
  assert.deepEqual(keys({ actions: ['reconnect'], state: 'RTN_UNACKED', active: false }), ['acknowledge']);
  assert.deepEqual(keys({ state: 'ACKED' }), ['shelve']);
  assert.deepEqual(keys({ state: 'SHELVED' }), ['unshelve']);
  assert.deepEqual(shown([alarm('a')], [], false)[0]?.keys, []);
});

test('an acknowledged alarm whose owner is off duty is named so, can be taken over, and is not called acknowledged alone', (t) => {
  t.mock.timers.enable({ apis: ['Date'], now: new Date(2026, 10, 19, 23, 0).getTime() });
  const off = { state: 'ACKED', acknowledged_by: 'A. K. (Pixel)', off_duty_ms: new Date(2026, 10, 19, 14, 2, 30).getTime(), actions: ['shelve'], for_s: 90 };
  const rows = shown([alarm('a', off)]);
  assert.match(rows[0]?.state ?? '', /^acknowledged by A\. K\. \(Pixel\), off duty since 14:02 · active for/);
  assert.match(standingWords(alarm('a', off)), /acknowledged by A\. K\. \(Pixel\), off duty since 14:02/);
  assert.deepEqual(rows[0]?.keys, ['shelve', 'take_alarm']);
  assert.equal(countWords(rows), '1 without an owner on duty');
  assert.deepEqual(shown([alarm('new', { state: 'ACKED', raised_ms: 9 }), alarm('left', off), alarm('waits')]).map(({ id }) => id), ['waits', 'left', 'new']);
  const owned = shown([alarm('a', { ...off, off_duty_ms: null })]);
  assert.deepEqual([owned[0]?.keys, countWords(owned)], [['shelve'], 'all acknowledged']);
  assert.deepEqual(shown([alarm('a', off)], [], false)[0]?.keys, []);
});

test('one tap answers together what waits on this page, stands, is not critical, and was in sight for a second', () => {
  const rows = shown([alarm('worst', { priority: 'critical' }), alarm('a'), alarm('b', { priority: 'advisory' }), alarm('ended', { state: 'RTN_UNACKED', active: false }), alarm('known', { state: 'ACKED' })]);
  const since = new Map(rows.map(({ key }) => [key, 0]));
  const answered = (/** @type {any[]} */ page, /** @type {number} */ now_ms, seen = since) => {
    const { alarms, isReady } = together(page, seen, now_ms);
    return [alarms.map(({ id }) => id), isReady];
  };
  assert.deepEqual(answered(rows, 1000), [['a', 'b'], true]);
  assert.deepEqual(answered(rows, 999), [['a', 'b'], false]);
  assert.deepEqual(answered(rows.slice(2), 1000), [['b'], true]);
  assert.deepEqual(answered(rows, 5000, new Map([...since, [rows[2]?.key ?? '', 4500]])), [['a', 'b'], false], 'one has just come');
  assert.deepEqual(answered(rows, 5000, new Map()), [['a', 'b'], false], 'never seen');
});

test('no row of a page is sliced, and each is on one page', () => {
  assert.deepEqual(pagesOf([124, 124, 124, 77, 77], 372), [0, 3]);
  assert.deepEqual(pagesOf([124, 124, 124], 371), [0, 2]);
  assert.deepEqual(pagesOf([900, 80], 400), [0, 1], 'one that is higher than the room has a page of its own');
  assert.deepEqual(pagesOf([], 400), [0]);
});

test('who took the sound is shown, and until when', () => {
  assert.match(silentWords(alarm('a', { silenced_until_ms: 1000, silenced_by: 'Ann' })), /^silent until \d\d:\d\d:\d\d by Ann$/);
  assert.equal(silentWords(alarm('a')), '');
});

test('a row shows the measured value and its limit, where both are known', () => {
  const quantity = (/** @type {number} */ value, unit = 'm/s') => ({ label: '', value, unit });
  const detail = (/** @type {any} */ more) => shown([alarm('a', { verdict: 'fault', measured: quantity(12.6), limit: quantity(11), ...more })])[0]?.detail;
  assert.equal(detail({}), '12.6 m/s (limit 11.0 m/s)');
  const labelled = (/** @type {string} */ label, /** @type {number} */ value, unit = 's') => ({ label, value, unit });
  assert.equal(detail({ measured: labelled('Silent for', 16.4), limit: labelled('Allowed', 1) }), 'no message for 16.4 s (limit 1.0 s)');
  assert.equal(detail({ measured: labelled('Rate', 5, 'Hz'), limit: labelled('Expected', 20, 'Hz') }), '5.0 Hz (expected 20.0 Hz)');
  assert.equal(detail({ measured: labelled('Slow', 3, ''), limit: labelled('Of', 5, '') }), '3 of 5');
  assert.equal(detail({ limit: quantity(3, 's') }), 'now');
  assert.match(detail({ verdict: 'unknown', text: 'Speed is 4.2 s old' }) ?? '', /^Not checked now: speed is 4.2 s old/);
  assert.equal(detail({ state: 'RTN_UNACKED', active: false }), 'then');
});

test('states are named in the terms of ISA-18.2', () => {
  const state = (/** @type {any} */ more) => shown([alarm('a', more)])[0]?.state;
  assert.equal(state({}), 'unacknowledged');
  assert.equal(state({ state: 'RTN_UNACKED', active: false }), 'ended, unacknowledged');
  assert.equal(state({ state: 'ACKED', acknowledged_by: 'Ann', active: false }), 'acknowledged by Ann');
  assert.match(state({ state: 'SHELVED', shelved_by: 'Ann', shelved_until_ms: 0 }) ?? '', /^shelved until \d\d:\d\d:\d\d by Ann$/);
});

test('what is shelved or suppressed is not called acknowledged', () => {
  assert.equal(countWords(shown([alarm('known', { state: 'ACKED' })])), 'all acknowledged');
  assert.equal(countWords(shown([alarm('known', { state: 'ACKED' }), alarm('shelved', { state: 'SHELVED' })])), 'none to acknowledge');
  assert.equal(countWords([]), '');
});

test('an empty list shows "no alarms" only where alarms could have come', () => {
  const usual = { isSilent: false, isReplay: false, isPaused: false, isChecked: true };
  const detail = (/** @type {Partial<typeof usual>} */ more) => noneWords({ ...usual, ...more });
  assert.equal(detail({}), 'No alarms.');
  assert.equal(detail({ isReplay: true }), 'No alarms at this moment of the recording.');
  for (const more of [{ isSilent: true }, { isPaused: true }, { isPaused: true, isReplay: true }, { isChecked: false }, { isChecked: false, isReplay: true }]) {
    assert.doesNotMatch(detail(more), /^No alarms/);
  }
});

test('a quiet list shows which alarm ended last and how many came lately', () => {
  /** @param {string | null} alarm @param {string} change @param {number} at_ms */
  const row = (alarm, change, at_ms) => /** @type {any} */ ({ event: { alarm, change, at_ms, title: 'Car not moving', text: '' }, gap: null });
  const at_ms = new Date(2026, 4, 6, 14, 3, 58).getTime();
  const log = [row(null, 'settings', at_ms + 2000), row('a', 'raised', at_ms + 1000), { event: null, gap: /** @type {any} */ ({}) }, row('a', 'cleared', at_ms), row('b', 'cleared', at_ms - 5000)];
  assert.equal(latelyWords(log, 2), 'Last: Car not moving, ended 14:03:58. In 10 min: 2 alarms.');
  assert.equal(latelyWords(log, 1), 'Last: Car not moving, ended 14:03:58. In 10 min: 1 alarm.');
  assert.equal(latelyWords(log, 0), 'Last: Car not moving, ended 14:03:58.');
  assert.equal(latelyWords([row('a', 'raised', at_ms)], 0), '');
  assert.equal(latelyWords([], undefined), '');
});
