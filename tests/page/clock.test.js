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

test('a frame held up for seconds is shown as old, and a steady delay is never taken for an offset', () => {
  const clock = new ServerClock();
  clock.note(SKEW, 0);
  for (let s = 1; s <= 600; s += 1) assert.ok(clock.note(SKEW + s * 1000, s * 1000 + 5000) > 4800, `after ${s} s`);
});

test('a drift of 100 ppm does not age frames', () => {
  const clock = new ServerClock();
  for (let s = 0; s <= 36000; s += 1) assert.ok(clock.note(SKEW + s * 1000, s * 1000 * 1.0001) < 1);
});

test('a late greeting is no offset: over all connections to one run of a server the least delay counts', () => {
  const clock = new ServerClock();
  clock.greeted({ run: 'a', time_ms: SKEW }, 50, 0);
  assert.ok(Math.abs(clock.greeted({ run: 'a', time_ms: SKEW + 60_000 }, 61_110, 59_000) - 1060) < 10); // it was 1.06 s under way
  assert.equal(clock.greeted({ run: 'b', time_ms: SKEW - 3_600_000 }, 62_000, 61_900), 0); // another server's clock
});

test('a first greeting that is late is as old as the dial and 0.2 s allow, and a request with its answer narrows it', () => {
  const clock = new ServerClock();
  assert.equal(clock.greeted({ run: 'a', time_ms: SKEW + 300 }, 1600, 0), 1400); // made 0.3 s after the dial, 1.3 s under way: nobody can know
  assert.equal(clock.note(SKEW + 1900, 2100, 1800), 100); // requested 0.1 s before it was made: it was 0 to 0.3 s under way
  assert.ok(Math.abs(clock.note(SKEW + 2000, 3300) - 1200) < 1);
});

test('a clock that was set, or stood still while the phone slept, is measured anew', () => {
  const clock = new ServerClock();
  clock.note(SKEW + 100, 110, 90);
  assert.equal(clock.note(SKEW + 60_200, 210, 190), 0); // set ahead, or asleep
  assert.equal(clock.note(SKEW - 60_000, 310, 290), 0); // set back
});
