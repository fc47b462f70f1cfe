import assert from 'node:assert/strict';
import { test } from 'node:test';
import { AheadWindow, aheadOf, isWeak, limitsOf, measured } from '../../static/js/core/round-trip.js';

/** @param {number[]} samples @returns {import('../../static/js/core/round-trip.js').RoundTrip | null} */
const after = (...samples) => samples.reduce(measured, /** @type {any} */ (null));

test('it follows the round trip and its spread as RFC 6298 does', () => {
  assert.deepEqual(after(400), { mean_ms: 400, spread_ms: 200 });
  assert.deepEqual(after(400, 800), { mean_ms: 450, spread_ms: 250 });
  const steady = after(...Array(40).fill(160));
  assert.ok(Math.abs(Number(steady?.mean_ms) - 160) < 1 && Number(steady?.spread_ms) < 1);
});

test('the limits follow it, between bounds', () => {
  const [good, weak, bad, worst] = [after(...Array(20).fill(2)), after(...Array(20).fill(0).map((_, i) => 250 + 100 * (i % 3))), after(...Array(20).fill(0).map((_, i) => 500 + 700 * (i % 2))), after(60_000)].map(limitsOf);
  const unknown = limitsOf(null);
  assert.equal(good?.quiet_ms, 2500);
  assert.ok(Number(good?.dial_ms) >= 2000 && Number(good?.dial_ms) < 2010);
  assert.ok(Number(weak?.dial_ms) > 2300 && Number(weak?.dial_ms) < Number(bad?.dial_ms));
  assert.ok(Number(bad?.quiet_ms) > 3000 && Number(bad?.quiet_ms) < 8000);
  assert.deepEqual(worst, { dial_ms: 8000, ticket_ms: 8000, quiet_ms: 8000, spare_ms: 1500 });
  assert.ok(unknown.dial_ms >= 5000 && unknown.quiet_ms > Number(good?.quiet_ms));
});

test('a radio is weak from 0.3 s on', () => {
  assert.deepEqual([null, after(290), after(300)].map(isWeak), [false, false, true]);
});

test('over a slow radio states come ahead, and beside a quiet connection another is dialled', () => {
  assert.deepEqual([null, after(99), after(100)].map(aheadOf), [0, 0, 12]);
  assert.deepEqual([null, after(99), after(100), after(600), after(3000)].map((trip) => limitsOf(trip).spare_ms), [Infinity, Infinity, 1000, 1200, 1500]);
});

/** What may be under way after echoes that took so long, each requested after the one before. @param {number[]} waited_ms */
function windowAfter(waited_ms) {
  const window = new AheadWindow(400);
  waited_ms.forEach((ms, i) => window.answered(10_000 * i, 10_000 * i + ms));
  return window.size;
}

test('states under way become more, up to twelve, while answers come in time', () => {
  assert.deepEqual([[], [400], [400, 700], Array(40).fill(500)].map(windowAfter), [3, 4, 5, 12]);
});

test('they become fewer where three answers in a row are late, by as much as these were, and never none', () => {
  const many = Array(20).fill(400);
  assert.equal(windowAfter([...many, 5000, 5000]), 12, 'lost, perhaps');
  assert.equal(windowAfter([...many, 1600, 5000, 400, 5000, 5000]), 12);
  assert.equal(windowAfter([...many, 1600, 5000, 5000]), 6, 'the least of them counts');
  assert.equal(windowAfter([...many, ...Array(30).fill(9000)]), 1);
  assert.equal(windowAfter([...many, 9000, 9000, 9000, 400, 400]), 3, 'and more again');
});

test('an answer to what was sent before they became fewer does not count', () => {
  const window = new AheadWindow(400);
  for (const asked_ms of [0, 500, 1000, 1500, 2000, 2400]) window.answered(asked_ms, asked_ms + 1600);
  assert.equal(window.size, 1);
  window.answered(2600, 4300);
  assert.equal(window.size, 1);
});
