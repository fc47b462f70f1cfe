import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Drawing } from '../../static/js/core/drawing.js';
import { namesOf } from '../../static/js/shell/undrawn.js';

/** @param {Drawing} drawing @param {number} times */
function draw(drawing, times) {
  for (let i = 0; i < times; i += 1) drawing.completed();
}

test('a second without a completed drawing is a failure, and a second of drawings ends it', () => {
  const drawing = new Drawing();
  for (let i = 0; i < 5; i += 1) drawing.look(true);
  assert.equal(drawing.isFailed, false);
  drawing.look(true);
  assert.equal(drawing.isFailed, true);
  draw(drawing, 4);
  assert.equal(drawing.isFailed, true);
  draw(drawing, 1);
  assert.equal(drawing.isFailed, false);
});

test('a hidden page draws nothing, and has not failed when it is seen again', () => {
  const drawing = new Drawing();
  for (let i = 0; i < 100; i += 1) drawing.look(false);
  drawing.look(true);
  assert.equal(drawing.isFailed, false);
});

test('what fails at once counts at once, and each failure begins the second anew', () => {
  const drawing = new Drawing();
  drawing.failed();
  assert.equal(drawing.isFailed, true);
  draw(drawing, 4);
  drawing.failed();
  draw(drawing, 4);
  assert.equal(drawing.isFailed, true);
});

test('what fails again and again ends with a page that is loaded anew', () => {
  const drawing = new Drawing();
  for (let i = 0; i < 2; i += 1) {
    drawing.failed();
    draw(drawing, 10);
    assert.equal(drawing.isFailed, false);
  }
  drawing.failed();
  draw(drawing, 1000);
  assert.equal(drawing.isFailed, true);
});

test('failures half a minute apart are not one', () => {
  const drawing = new Drawing();
  for (let i = 0; i < 20; i += 1) {
    drawing.failed();
    draw(drawing, 160);
    assert.equal(drawing.isFailed, false);
  }
});

test('a browser whose functions do nothing is not believed again', () => {
  const drawing = new Drawing();
  drawing.distrust();
  draw(drawing, 1000);
  assert.equal(drawing.isFailed, true);
});

test('the alarms are named by nothing but loops, also while a recording is shown', () => {
  const alarm = (/** @type {string} */ title, more = {}) => ({ title, state: 'UNACKED', priority: 'critical', ...more });
  const frame = (/** @type {any[]} */ alarms) => /** @type {any} */ ({ alarms });
  assert.equal(namesOf(null), 'Alarms may be missing here.');
  assert.equal(namesOf(frame([alarm('A', { state: 'SHELVED' }), alarm('B', { priority: 'advisory' })])), 'Alarms may be missing here.');
  assert.equal(namesOf(frame(['A', 'B', 'C', 'D', 'E'].map((one) => alarm(one)))), 'Alarm: A, B, C and 2 more');
  const both = namesOf(frame([{ ...alarm('Then'), state: 'RTN_UNACKED' }, alarm('Now')]));
  assert.equal(both, 'Alarm: Now, Then (returned)', 'what stands comes first, and nothing that returned is called an alarm that stands');
  assert.equal(namesOf(/** @type {any} */ ({ replay: {}, alarms: [alarm('Then')], live: { alarms: [alarm('Now')] } })), 'Alarm: Now');
});
