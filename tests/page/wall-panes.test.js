// The panes of the widest screens: what of the signals and of the people is listed, and in which order.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Lines, peopleLines, signalLines } from '../../static/js/shell/wall-panes.js';

const signal = (/** @type {string} */ label, /** @type {string} */ freshness, more = {}) => ({ label, freshness, rate_hz: 20, age_s: 0.04, ...more });
const person = (/** @type {string} */ page, /** @type {string} */ name, more = {}) => ({ page, name, can: true, why_text: null, heard_s: 0.1, ...more });

test('signals that are not fresh are listed first; those nobody publishes are not', () => {
  const lines = signalLines(/** @type {any} */ ({
    speed: signal('Speed', 'fresh'), fuel: signal('Fuel', 'not_published'), scan: signal('Laser', 'stale', { rate_hz: 0, age_s: 7.35 }),
    command: signal('Command', 'never', { rate_hz: null, age_s: null }), heading: signal('Heading', 'not_measured', { age_s: null }),
  }));
  assert.deepEqual(lines.map(({ cells }) => cells), [['Laser', '0.0 Hz', 'STALE 7.3 s'], ['Command', 'no message yet', '–'], ['Heading', 'not measured', '–'], ['Speed', '20.0 Hz', '0.04 s']]);
});

test('who is in control stands first, then this page; why one cannot hear an alarm is shown', () => {
  const reach = /** @type {any} */ ({ can: 2, of: 3, left_out: 0, pages: [person('c', 'Field 2', { can: false, why_text: 'sound is off' }), person('b', 'Desk 2'), person('a', 'Desk 1')] });
  const { head, lines } = peopleLines(reach, /** @type {any} */ ({ page: 'a' }), 'b');
  assert.equal(head, '3 pages, alarms audible on 2');
  assert.deepEqual(lines.map(({ cells }) => cells.slice(0, 3)), [['Desk 1', 'in control', 'alarms audible'], ['Desk 2, you', 'watching', 'alarms audible'], ['Field 2', 'watching', 'sound is off']]);
  assert.deepEqual(peopleLines(null, null, 'a'), { head: 'unknown', lines: [] });
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
