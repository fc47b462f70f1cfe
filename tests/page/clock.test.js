import assert from 'node:assert/strict';
import { test } from 'node:test';
import { ServerClock } from '../../static/js/core/clock.js';

const SKEW = 1_790_000_000_000; // the clocks of server and page have nothing to do with one another

test('the fastest frame has no age, a slower one its delay', () => {
  const clock = new ServerClock();
  assert.equal(clock.note(SKEW, 1000), 0);
  assert.ok(Math.abs(clock.note(SKEW + 100, 1130) - 30) < 1);
  assert.equal(clock.note(SKEW + 200, 1195), 0); // faster than any before
});

test('a frame held up for seconds is told as old, and a steady delay is never taken for an offset', () => {
  const clock = new ServerClock();
  clock.note(SKEW, 0);
  for (let s = 1; s <= 600; s += 1) assert.ok(clock.note(SKEW + s * 1000, s * 1000 + 5000) > 4800, `after ${s} s`);
});

test('a drift of 100 ppm does not age frames', () => {
  const clock = new ServerClock();
  for (let s = 0; s <= 36000; s += 1) assert.ok(clock.note(SKEW + s * 1000, s * 1000 * 1.0001) < 1);
});

test('a new connection starts afresh', () => {
  const clock = new ServerClock();
  clock.note(SKEW, 0);
  clock.reset();
  assert.equal(clock.note(SKEW - 3_600_000, 1000), 0); // the server's clock was set back an hour
});
