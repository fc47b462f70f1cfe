// The texts and places of the departure check.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { dueWords, intervalWords, lastWords } from '../../static/js/drive/due.js';
import { added, barOf, countWords, doneOf, failedWords, fixOf, isSame, leftWords, lineWords, moved, needWords, nextOf, rowsOf, shortHash, stateWords, valueOf } from '../../static/js/drive/departure-layout.js';

const AT = new Date(2026, 10, 19, 14, 0, 12).getTime();
const item = (/** @type {any} */ more = {}) => /** @type {any} */ ({
  id: 'doors', title: 'Doors shut', kind: 'manual', group: 'manual', of: '', need: null, unit: '', fix: '', result: 'open', value: '', note: '', by: null, at_ms: null, is_fixed: false, now: null, peak: null, ...more,
});
const BRAKE = item({ id: 'brake', title: 'Press the brake', kind: 'brake', group: 'active', need: 20, unit: '%', now: 14, peak: 16 });
const CLOCK = item({ id: 'clock', title: 'Clock', kind: 'clock', group: 'automatic', need: 0.2, unit: 's', result: 'failed', value: 'differs 0.84 s' });
const DONE = item({ id: 'tyres', title: 'Tyres', result: 'done', by: 'A. K. (Pixel)', at_ms: AT });
const check = (/** @type {any[]} */ items, /** @type {any} */ more = {}) => /** @type {any} */ ({
  state: 'open', items, signature: null, of: items.length, done: items.filter(({ result }) => result === 'done').length, failed: items.filter(({ result }) => result === 'failed').length,
  not_applicable: items.filter(({ result }) => result === 'not_applicable').length, ...more,
});

test('active, failed, open, done, in this order', () => {
  const all = check([DONE, item(), CLOCK, BRAKE]);
  assert.deepEqual(rowsOf(all).map(([{ id }, face]) => `${id} ${face}`), ['brake now', 'clock failed', 'doors open', 'tyres done']);
  assert.equal(nextOf(all)?.id, 'brake');
  assert.equal(nextOf(check([item(), { ...BRAKE, now: null }]))?.id, 'doors', 'what cannot be seen is not next');
  assert.equal(nextOf(check([item()], { state: 'none' })), null);
  assert.deepEqual([doneOf(all), leftWords(all), countWords(all)], ['1 of 4', '1 failed, 2 open', '1 done']);
  assert.equal(leftWords(check([DONE])), '');
});

test('what an item needs and what became of it', () => {
  assert.equal(needWords(BRAKE), 'do and see: 20 % or more, once');
  assert.equal(needWords(item({ kind: 'steering', group: 'active', need: 5, unit: '°' })), 'do and see: 5° left, then 5° right');
  assert.equal(needWords(item({ kind: 'sound', group: 'automatic', need: 1 })), 'by itself: on 1 phone or more');
  assert.equal(lineWords(DONE), 'by hand, 14:00:12, A. K. (Pixel)');
  assert.equal(lineWords(item({ result: 'not_applicable', note: 'Not fitted to this car' })), 'not applicable: not fitted to this car');
  assert.equal(lineWords({ ...CLOCK, result: 'done', value: 'differs 0.02 s', at_ms: AT, is_fixed: true }), 'by itself: differs 0.02 s, fixed 14:00:12');
  assert.equal(lineWords({ ...BRAKE, result: 'done', value: '34 %', at_ms: AT }), 'seen: 34 % at 14:00:12');
  assert.deepEqual(failedWords(CLOCK), ['Clock: differs 0.84 s', '0.2 s allowed']);
  assert.equal(fixOf(item({ kind: 'recorder' }))?.label, 'Start recording');
  assert.equal(fixOf(CLOCK), null);
});

test('the bar of an active item', () => {
  assert.deepEqual([barOf(BRAKE).to, barOf(BRAKE).needs, barOf(BRAKE).peak], [14, [20], 16]);
  const left = barOf(item({ kind: 'steering', need: 5, now: 15, unit: '°' }));
  assert.deepEqual([left.from, left.to, left.needs], [0, 50, [33.3, 66.7]]);
  assert.deepEqual(valueOf(item({ kind: 'steering', need: 5, now: -3.21, unit: '°' })), ['3.2', '° right']);
  assert.deepEqual(valueOf({ ...BRAKE, now: null }), ['–', '%']);
});

test('the list as it is edited', () => {
  const rows = /** @type {any} */ ([{ id: 'a', title: 'A', kind: 'manual' }, { id: 'b', title: 'B', kind: 'manual' }]);
  assert.deepEqual(moved(rows, 'b', -1).map(({ id }) => id), ['b', 'a']);
  assert.deepEqual(moved(rows, 'b', 1), rows);
  assert.deepEqual(added(rows, ' A ').at(-1), { id: 'a_2', title: 'A', kind: 'manual' });
  assert.equal(added(rows, '車').at(-1)?.id, 'item');
  assert.ok(isSame(rows, rows.map((row) => ({ ...row }))));
  assert.ok(!isSame(rows, moved(rows, 'b', -1)), 'another order is another list');
});

test('its state in short', () => {
  assert.equal(stateWords(undefined), 'Departure check: not begun');
  assert.equal(stateWords(check([DONE, CLOCK])), 'Departure check: 1 of 2, 1 failed');
  assert.equal(stateWords(check([DONE], { state: 'signed', by: 'A. K. (Pixel)' })), 'Departure check: signed by A. K. (Pixel)');
  assert.equal(shortHash('7c1e04b9aa'), '7c1e 04b9');
});

const due = (/** @type {any} */ more) => /** @type {any} */ ({ every_days: null, every_km: null, done_ms: AT, due_days: null, due_km: null, is_least: false, is_overdue: false, ...more });

test('how often an item is due, and when', () => {
  assert.equal(intervalWords(due({})), '');
  assert.equal(intervalWords(due({ every_days: 1 })), 'every day');
  assert.equal(intervalWords(due({ every_days: 30, every_km: 500 })), 'every 30 days or 500 km');
  assert.equal(dueWords(due({ every_days: 30, due_days: 9, every_km: 500, due_km: 120.4 })), 'due in 9 days or 120 km');
  assert.equal(dueWords(due({ every_days: 30, due_days: 0 })), 'due in less than a day');
  assert.equal(dueWords(due({ every_days: 30, due_days: -12, every_km: 500, due_km: -0.5, is_overdue: true })), '12 days and 0.5 km late');
  assert.equal(dueWords(due({ every_days: 30, due_days: 4, every_km: 500, due_km: -41, is_overdue: true })), '41 km late');
  assert.equal(dueWords(due({ every_km: 500 })), 'distance not known');
  assert.equal(dueWords(due({ every_days: 3, done_ms: null, is_overdue: true })), 'never done');
  assert.equal(lastWords(due({ is_least: true })), 'last 19 Nov 2026; it was driven farther than is known');
  assert.equal(lastWords(due({ done_ms: null })), '');
  assert.equal(lineWords(item(), 'every 30 days, 12 days late'), 'by hand: press when done · every 30 days, 12 days late');
});
