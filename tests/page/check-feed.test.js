import assert from 'node:assert/strict';
import { test } from 'node:test';
import { CheckFeed } from '../../static/js/alarms/check-feed.js';

/** @param {import('node:test').TestContext} t @param {number} status @param {object | null} replay */
const opened = (t, status, replay) => {
  const requests = [];
  t.mock.method(globalThis, 'fetch', async (url) => {
    requests.push(url);
    return { ok: status === 200, status, json: async () => ({}) };
  });
  const store = { frame: { vehicle: 'car', replay, checks: [], alarms: [] }, log: { last: null }, replaying: replay !== null, now: () => store.now_ms, now_ms: 0 };
  const feed = new CheckFeed(store, 'speed_limit', () => undefined);
  const look = async (ms) => {
    store.now_ms = ms;
    feed.look();
    await new Promise(setImmediate);
  };
  return { feed, store, look, requests };
};

test('a replay that is over is requested once, and shown as over; another moment is requested again', async (t) => {
  const { feed, store, look, requests } = opened(t, 404, { token: 'a', seek: 1, is_seeking: false });
  for (const ms of [0, 2000, 4000]) await look(ms);
  assert.equal(requests.length, 1);
  assert.equal(feed.problem, 'This replay is over.');
  assert.equal(feed.isOld, false);
  store.frame.replay = { token: 'b', seek: 1, is_seeking: false };
  await look(6000);
  assert.equal(requests.length, 2);
});

test('a check that the server does not have is requested once; one of a car that is away is requested again', async (t) => {
  const unknown = opened(t, 409, null);
  for (const ms of [0, 2000, 4000]) await unknown.look(ms);
  assert.equal(unknown.requests.length, 1);
  t.mock.restoreAll();
  const away = opened(t, 404, null);
  for (const ms of [0, 2000, 4000]) await away.look(ms);
  assert.equal(away.requests.length, 3);
});
