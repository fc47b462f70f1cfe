// The panes of the widest screens: what of the signals and of the people is listed, and in which order.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { headsOf } from '../../static/js/shell/panes.js';
import { Lines, peopleLines, signalLines } from '../../static/js/shell/wall-panes.js';

const signal = (/** @type {string} */ label, /** @type {string} */ freshness, more = {}) => ({ label, freshness, rate_hz: 20, age_s: 0.04, ...more });
const person = (/** @type {string} */ page, /** @type {string} */ name, more = {}) => ({ page, name, can: true, why_text: null, heard_s: 0.1, ...more });

test('signals that are stale or absent are listed first, then ageing ones; those nobody publishes are not', () => {
  const lines = signalLines(/** @type {any} */ ({
    speed: signal('Speed', 'fresh'), odometry: signal('Odometry', 'ageing', { age_s: 0.34 }), fuel: signal('Fuel', 'not_published'), scan: signal('Laser', 'stale', { rate_hz: 0, age_s: 7.35 }),
    command: signal('Command', 'never', { rate_hz: null, age_s: null }), heading: signal('Heading', 'not_measured', { age_s: null }),
  }), 0);
  assert.deepEqual(lines.map(({ cells }) => cells), [['Laser', '0.0 Hz', 'STALE 7.3 s'], ['Command', 'no message yet', '–'], ['Heading', 'not measured', '–'], ['Odometry', '20.0 Hz', '0.34 s'], ['Speed', '20.0 Hz', '0.04 s']]);
});

test('between two frames ages go on, and what is past its horizon is stale', () => {
  const signals = /** @type {any} */ ({ speed: signal('Speed', 'fresh', { horizon_s: 1 }), scan: signal('Laser', 'fresh', { horizon_s: 5 }) });
  assert.deepEqual(signalLines(signals, 2).map(({ ink, cells }) => [ink, cells[0], cells[2]]), [['stale', 'Speed', 'STALE 2.0 s'], ['ageing', 'Laser', '2.0 s']]);
});

test('the heads state nothing of a phone that is not compared, nor of alarms where nothing is judged', () => {
  const frame = (/** @type {any} */ more) => /** @type {any} */ ({ phone: { used: true, apart_m: 10.4, explained_m: 14, compared_age_s: 1 }, signals: {}, alarms: [], session: { paused: false }, ...more });
  const heads = (/** @type {any} */ more, isChecked = true) => { const { map, alarms } = headsOf(frame(more), isChecked, 0.5); return [map, alarms]; };
  assert.deepEqual(heads({}), ['Distance apart 10.4 of 14.0 m', 'none active']);
  assert.deepEqual(heads({ phone: { used: false, apart_m: 10.4, explained_m: 14 } }, false), ['', 'not checked']);
  assert.deepEqual(heads({ phone: { used: true, apart_m: 10.4, explained_m: 14, compared_age_s: 60 } })[0], '', 'an old comparison');
  assert.deepEqual(heads({ phone: null, session: { paused: true } }), ['', '']);
});

test('who is in control stands first, then who hears no alarm and why, then this page', () => {
  const reach = /** @type {any} */ ({ can: 2, of: 3, left_out: 0, pages: [person('c', 'Field 2', { can: false, why_text: 'sound is off' }), person('b', 'Desk 2'), person('a', 'Desk 1')] });
  const { head, lines } = peopleLines(reach, /** @type {any} */ ({ page: 'a' }), 'b');
  assert.equal(head, '3 pages, alarms audible on 2');
  assert.deepEqual(lines.map(({ cells }) => cells.slice(0, 3)), [['Desk 1', 'in control', 'alarms audible'], ['Field 2', 'watching', 'sound is off'], ['Desk 2, you', 'watching', 'alarms audible']]);
  assert.deepEqual(peopleLines(null, null, 'a'), { head: 'unknown', lines: [{ key: '', cells: ['No list received', '', '', ''] }] });
});

test('a displayed list without room for a line counts all of them; one that is not displayed counts none', (t) => {
  /** @type {(entries: any[]) => void} */
  let resized = () => {};
  class ResizeObserver {
    constructor(/** @type {typeof resized} */ done) { resized = done; }
    observe() {}
  }
  const browser = { ResizeObserver, document: {}, getComputedStyle: () => ({ fontSize: '16px' }) };
  Object.assign(globalThis, browser);
  t.after(() => Object.keys(browser).forEach((name) => Reflect.deleteProperty(globalThis, name)));
  const lines = new Lines(/** @type {any} */ ({ children: [], replaceChildren() {} }));
  const all = () => [{ key: 'a', cells: ['A'] }, { key: 'b', cells: ['B'] }];
  assert.equal(lines.draw(all), 0);
  resized([{ contentRect: { width: 0, height: 0 } }, { contentRect: { width: 300, height: 8 } }]);
  assert.equal(lines.draw(all), 2);
  resized([{ contentRect: { width: 0, height: 0 } }]);
  assert.equal(lines.draw(all), 0);
});
