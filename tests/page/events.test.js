import assert from 'node:assert/strict';
import { test } from 'node:test';
import { EventLog, gapWords } from '../../static/js/core/event-log.js';

const event = (/** @type {number} */ n, change = 'raised') => /** @type {any} */ ({ n, at_ms: n, alarm: 'speed_limit', occurrence: 1, change, title: 'Speed', priority: 'critical', text: '' });
const hello = (/** @type {string} */ boot, /** @type {number} */ last_event, resumes = true) => ({ boot, last_event, resumes });

test('each event exactly once and in order, whatever is sent again', () => {
  const log = new EventLog();
  log.greet(hello('a', 0), 0, 0);
  assert.deepEqual(log.take([event(1), event(2)]).map(({ n }) => n), [1, 2]);
  assert.deepEqual(log.take([event(3), event(2), event(1)]).map(({ n }) => n), [3]);
  assert.deepEqual(log.rows.map((row) => row.event?.n), [3, 2, 1]);
  assert.equal(log.last, 3);
});

test('a page that begins requests a little of the past and announces none of it', () => {
  const log = new EventLog();
  assert.equal(log.greet(hello('a', 117), 0, 0), 67);
  log.take([event(68), event(117)]);
  assert.equal(log.caughtUp(), null);
});

test('after a gap the page announces what happened meanwhile, once', () => {
  const log = new EventLog();
  log.greet(hello('a', 0), 0, 0);
  log.take([event(1)]);
  assert.equal(log.greet(hello('a', 4), 14.2, 99), 1);
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

test('a blind time goes on over a connection that broke before its events came', () => {
  const log = new EventLog();
  log.greet(hello('a', 1), 0, 0);
  log.take([event(1)]);
  log.greet(hello('a', 3), 60, 70);
  assert.equal(log.caughtUp(), null);
  log.greet(hello('a', 4), 0.5, 71); // one state came meanwhile, and no event
  log.take([event(2), event(3), event(4, 'cleared')]);
  assert.deepEqual(log.caughtUp(), { blind_s: 60, raised: 2, cleared: 1, at_ms: 70 });
});

test('a short flicker is no gap, and a quiet gap is shown as one', () => {
  const log = new EventLog();
  log.greet(hello('a', 3), 0, 0);
  log.take([event(3)]);
  log.greet(hello('a', 3), 0.4, 0);
  assert.equal(log.caughtUp(), null);
  log.greet(hello('a', 3), 8, 0);
  const gap = log.caughtUp();
  assert.equal(gap && gapWords(gap), 'No data for 8 s; no alarm began or ended');
});

test('a server of before that counts afresh is read from its first event on', () => {
  const log = new EventLog();
  log.greet(hello('a', 117, false), 0, 0);
  log.take([event(117)]);
  assert.equal(log.greet(hello('b', 2, false), 5, 0), 0);
  assert.deepEqual(log.take([event(1), event(2)]).map(({ n }) => n), [1, 2]);
  assert.equal(log.caughtUp()?.raised, 2);
});

test('a restarted server that kept its log goes on where it was', () => {
  const log = new EventLog();
  log.greet(hello('a', 117), 0, 0);
  log.take([event(117)]);
  assert.equal(log.greet(hello('b', 119), 5, 0), 117);
  assert.equal(log.boot, 'a', 'what this page has is of the former run');
  assert.deepEqual(log.take([event(118)]), [], 'it was sent before the server knew what this page has');
  assert.equal(log.caughtUp(), null);
  assert.deepEqual(log.take([event(118), event(119)], { common: 117, new_after: 117 }).map(({ n }) => n), [118, 119]);
  assert.equal(log.boot, 'b');
  assert.equal(log.caughtUp()?.raised, 2);
});

test('numbers that another run gives again are new, and what its log lacks is gone', () => {
  const log = new EventLog();
  log.greet(hello('a', 0), 0, 0);
  log.take([1, 2, 3, 4].map((n) => event(n)));
  log.greet(hello('b', 3), 5, 0);
  const fresh = log.take([{ ...event(3), at_ms: 9 }], { common: 2, new_after: 2 });
  assert.deepEqual(fresh.map(({ n }) => n), [3]);
  assert.deepEqual(log.rows.flatMap(({ event }) => event?.at_ms ?? []), [9, 2, 1]);
  log.greet(hello('c', 2), 5, 0);
  assert.deepEqual(log.take([], { common: 2, new_after: 2 }), []);
  assert.equal(log.last, 2);
});

test('of a log that is not known, old events are listed and not announced, and new ones are', () => {
  const log = new EventLog();
  log.greet(hello('a', 0), 0, 0);
  log.take([event(5), event(6)]);
  log.greet(hello('x', 5), 5, 0);
  const again = { ...event(6), n: 2 }; // the same event by another number
  const late = { ...event(7), n: 3 };
  const early = { ...event(4), n: 4 }; // of this run, whose clock was set back
  const fresh = log.take([{ ...event(3), n: 1 }, again, late, early], { common: 0, new_after: 3 });
  assert.deepEqual(fresh.map(({ n }) => n), [3, 4]);
  assert.deepEqual(log.rows.flatMap(({ event }) => event?.n ?? []), [4, 3, 2, 1]);
});
