import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { gapLine } from '../../static/js/alarms/log-layout.js';
import { EventLog } from '../../static/js/core/event-log.js';
import { KEPT_M, LATE_ABOVE_S, keptSpeed, proposalOf, unseenMetres, unseenOf, unseenWords } from '../../static/js/core/unseen.js';
import { chooseSpeedUnit } from '../../static/js/core/units.js';

test('an unknown speed, age or limit is not known, and never 0', () => {
  for (const odd of [null, undefined, NaN, Infinity, -Infinity]) {
    assert.equal(unseenMetres(odd, 1, 3), null);
    assert.equal(unseenMetres(1, odd, 3), null);
    assert.equal(unseenMetres(1, 1, odd), null);
    assert.equal(keptSpeed(odd), null);
  }
  assert.equal(unseenMetres(1, -0.1, 3), null);
  assert.equal(unseenMetres(1, 1, 0), null);
  assert.equal(unseenWords(null), 'distance driven unknown');
});

test('the page counts as the server does', () => { // tests/monitor/test_unseen.py reads the same table
  const table = JSON.parse(readFileSync(new URL('../monitor/unseen.json', import.meta.url), 'utf-8'));
  assert.deepEqual([KEPT_M, LATE_ABOVE_S], [table.kept_m, table.late_above_s]);
  for (const [speed_mps, age_s, limit, metres, text] of table.ways) {
    assert.deepEqual([unseenMetres(speed_mps, age_s, limit), unseenWords(unseenMetres(speed_mps, age_s, limit))], [metres, text]);
  }
  for (const [late_s, kept_mps] of table.kept) assert.equal(keptSpeed(late_s), kept_mps);
});

test('no drive within the limit is longer than the bound, and the text is never less than it', () => {
  let seed = 7;
  const next = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  for (let round = 0; round < 300; round += 1) {
    const [start_mps, age_s, limit] = [60 * next() - 30, 30 * next(), 0.5 + 14 * next()];
    const bound_m = unseenMetres(start_mps, age_s, limit) ?? NaN;
    let [speed_mps, way_m] = [start_mps, 0];
    const step_s = age_s / 50;
    for (let i = 0; i < 50; i += 1) {
      const push = limit * (2 * next() - 1);
      way_m += Math.abs(speed_mps * step_s + (push * step_s * step_s) / 2);
      speed_mps += push * step_s;
    }
    assert.ok(way_m <= bound_m + 1e-9, `${way_m} > ${bound_m}`);
    const [, number = '', unit] = unseenWords(bound_m).match(/^≤ ([\d.]+) (k?m) unseen$/) ?? [];
    assert.ok(Number(number) * (unit === 'km' ? 1000 : 1) >= bound_m, `${unseenWords(bound_m)}: ${bound_m}`);
  }
});

test('a car that stood may drive too', () => {
  assert.equal(unseenMetres(0, 2, 3), 6);
  assert.equal(unseenMetres(-4, 2, 3), 14);
  assert.equal(unseenWords(2.71), '≤ 2.8 m unseen');
  assert.equal(unseenWords(99.91), '≤ 100 m unseen');
  assert.equal(unseenWords(999.2), '≤ 1.0 km unseen');
  assert.equal(unseenWords(5401), '≤ 5.5 km unseen');
});

/** @param {object} more */
function glass(more = {}) {
  const limits = { 'unseen.acceleration_mps2': 3, 'unseen.proposes_speed': 1 };
  return /** @type {any} */ ({
    frame: { link: { late_s: 0.15, most_late_s: 0.25 } }, isSilent: false, silence_s: 0.1, lag_s: 0.1, chain: { cut: null },
    limit: (/** @type {keyof typeof limits} */ name) => limits[name] ?? null,
    signal: () => ({ value: { speed_mps: 4 } }), ink: () => ({ ink: 'stale', age_s: 2 }), ...more,
  });
}

test('the bound at the glass is that of the last speed', () => {
  assert.equal(unseenOf(glass()), 14);
  assert.equal(unseenOf(glass({ signal: () => ({ value: { speed_mps: null } }) })), null);
  assert.equal(unseenOf(glass({ signal: () => ({ value: null }) })), null);
  assert.equal(unseenOf(glass({ limit: () => null })), null);
});

test('a speed is proposed above 200 ms, from the car to the glass, and never rounded up', () => {
  assert.deepEqual(proposalOf(glass()), ['≤ 11.1 m/s', 'for 2.78 m']);
  assert.deepEqual(proposalOf(glass({ frame: { link: { late_s: 0.2 } } })), []);
  assert.deepEqual(proposalOf(glass({ frame: { link: { late_s: 0.0, most_late_s: 0.1 } }, lag_s: 0.5 })), ['≤ 5.5 m/s', 'for 2.78 m']); // 0.4 s of it from the server here
  assert.deepEqual(proposalOf(glass({ frame: { link: { late_s: 1.5 } } })), ['≤ 1.8 m/s', 'for 2.78 m']);
  chooseSpeedUnit('km/h');
  assert.deepEqual(proposalOf(glass()), ['≤ 40.0 km/h', 'for 2.78 m']);
  chooseSpeedUnit('m/s');
});

test('no speed is proposed unless the setting requires it, nor while nothing comes', () => {
  assert.deepEqual(proposalOf(glass({ limit: () => 0 })), []);
  assert.deepEqual(proposalOf(glass({ limit: () => null })), []);
  assert.deepEqual(proposalOf(glass({ isSilent: true })), []);
  assert.deepEqual(proposalOf(glass({ chain: { cut: 2 } })), []);
  assert.deepEqual(proposalOf(glass({ frame: null })), []);
  assert.deepEqual(proposalOf(glass({ frame: { link: { late_s: null, most_late_s: null } } })), ['delay', 'not known']);
});

test('a blind time has its metres once the first values after it came', () => {
  const log = new EventLog();
  log.greet({ boot: 'a', last_event: 0 }, 0, 0);
  log.seen(5); // no gap
  log.greet({ boot: 'a', last_event: 0 }, 8, 0);
  const gap = /** @type {import('../../static/js/core/event-log.js').Gap} */ (log.caughtUp());
  assert.doesNotMatch(gapLine(gap), /unseen/);
  const before = log.measured;
  log.seen(134.2);
  assert.match(gapLine(gap), /, ≤ 135 m unseen$/);
  assert.ok(log.measured > before, 'a list that is shown is drawn anew');
  log.seen(1);
  assert.match(gapLine(gap), /, ≤ 135 m unseen$/);
  log.greet({ boot: 'a', last_event: 0 }, 9, 0);
  const other = /** @type {import('../../static/js/core/event-log.js').Gap} */ (log.caughtUp());
  log.seen(null);
  assert.match(gapLine(other), /, distance driven unknown$/);
});
