import assert from 'node:assert/strict';
import { test } from 'node:test';
import { aheadOf, isWeak, limitsOf, measured } from '../../static/js/core/round-trip.js';

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
