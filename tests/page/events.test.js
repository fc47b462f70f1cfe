import assert from 'node:assert/strict';
import { test } from 'node:test';
import { EventLog, gapWords } from '../../static/js/core/event-log.js';

const event = (/** @type {number} */ n, change = 'raised') => /** @type {any} */ ({ n, at_ms: n, alarm: 'speed_limit', occurrence: 1, change, title: 'Speed', priority: 'critical', text: '' });

test('each event exactly once and in order, whatever is sent again', () => {
  const log = new EventLog();
  log.greet('a', 0, 0, 0);
  assert.deepEqual(log.take([event(1), event(2)]).map(({ n }) => n), [1, 2]);
  assert.deepEqual(log.take([event(3), event(2), event(1)]).map(({ n }) => n), [3]);
  assert.deepEqual(log.rows.map((row) => row.event?.n), [3, 2, 1]);
  assert.equal(log.last, 3);
});

test('a page that begins asks for a little of the past and announces none of it', () => {
  const log = new EventLog();
  assert.equal(log.greet('a', 117, 0, 0), 67);
  log.take([event(68), event(117)]);
  assert.equal(log.caughtUp(), null);
});

test('after a gap the page says what happened meanwhile, once', () => {
  const log = new EventLog();
  log.greet('a', 0, 0, 0);
  log.take([event(1)]);
  assert.equal(log.greet('a', 4, 14.2, 99), 1);
  assert.equal(log.caughtUp(), null);
  log.take([event(2), event(3)]);
  assert.equal(log.caughtUp(), null); // one is missing still
  log.take([event(4, 'cleared')]);
  const gap = log.caughtUp();
  assert.equal(gap && gapWords(gap), 'No data for 14 s; 2 alarms began, 1 ended');
  assert.equal(log.caughtUp(), null);
  log.take([event(5)]);
  assert.equal(log.rows.find((row) => row.gap)?.gap?.raised, 2);
});

test('a short flicker is no gap, and a quiet gap says so', () => {
  const log = new EventLog();
  log.greet('a', 3, 0, 0);
  log.take([event(3)]);
  log.greet('a', 3, 0.4, 0);
  assert.equal(log.caughtUp(), null);
  log.greet('a', 3, 8, 0);
  const gap = log.caughtUp();
  assert.equal(gap && gapWords(gap), 'No data for 8 s; no alarm began or ended');
});

test('a server that counts afresh after a restart is heard from its first event on', () => {
  const log = new EventLog();
  log.greet('a', 117, 0, 0);
  log.take([event(117)]);
  assert.equal(log.greet('b', 2, 5, 0), 0);
  assert.deepEqual(log.take([event(1), event(2)]).map(({ n }) => n), [1, 2]);
  assert.equal(log.caughtUp()?.raised, 2);
});

test('a restarted server that kept its log goes on where it was', () => {
  const log = new EventLog();
  log.greet('a', 117, 0, 0);
  log.take([event(117)]);
  assert.equal(log.greet('b', 119, 5, 0), 117);
  assert.deepEqual(log.take([event(117), event(118), event(119)]).map(({ n }) => n), [118, 119]);
});
