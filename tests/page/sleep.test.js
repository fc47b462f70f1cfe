// A phone's monotonic clock stands still in its sleep: what the server sent before is never shown as live after it.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';
import { state } from './frames.js';

const Store = await storeAlone();

const HELLO = { kind: 'hello', boot: 'a', run: 'a', vehicle: 'car', vehicles: ['car'], build: '', last_event: 0 };

/** A page before a radio with a round trip of 0.4 s, moved by the test. @param {import('node:test').TestContext} t */
function page(t) {
  t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  let [now_ms, slept_ms] = [1000, 0];
  t.mock.method(performance, 'now', () => now_ms);
  t.mock.method(Date, 'now', () => now_ms + slept_ms);
  t.mock.method(Math, 'random', () => 0);
  /** @type {any[]} */
  const sockets = [];
  const store = new Store(() => sockets[sockets.push({ sent: [], send(/** @type {string} */ text) { this.sent.push(JSON.parse(text)); }, close() {} }) - 1]);
  store.vehicle = 'car';
  store.painter.picture = store.painter.look = store.painter.draw = () => {};
  store.start();
  t.after(() => store.stop());
  const pass = (/** @type {number} */ ms) => {
    for (let left = ms; left > 0; left -= 100) {
      now_ms += 100;
      t.mock.timers.tick(100);
    }
  };
  const say = (/** @type {any} */ socket, /** @type {object} */ message) => socket.onmessage?.({ data: JSON.stringify(message) });
  const show = (/** @type {any} */ socket, /** @type {number} */ time_ms) => say(socket, { ...state(), server: { time_ms, boot: 'a' } });
  /** What the server sends at once to a connection that opens: its greeting and three states. @param {any} socket @param {number} time_ms */
  const greet = (socket, time_ms) => {
    say(socket, { ...HELLO, time_ms });
    for (const late_ms of [0, 50, 100]) show(socket, time_ms + late_ms);
  };
  const open = (/** @type {any} */ socket) => socket.onopen?.();
  /** Live over its first connection, to a server that names takes. */
  const live = () => {
    pass(400);
    open(sockets[0]);
    pass(200);
    greet(sockets[0], now_ms - 200);
    say(sockets[0], { kind: 'offer', seq: 1, of: ['state'], took_ms: now_ms - 400, took: 0 });
    assert.equal(store.isSilent, false);
  };
  const sleep = () => {
    slept_ms += 60_000;
    t.mock.timers.tick(200); // the page looks before it reads anything
  };
  return { store, sockets, pass, sleep, live, open, greet, show, say, now: () => now_ms };
}

test('a connection that was being dialled when the phone slept uncovers nothing', (t) => {
  const { store, sockets, pass, sleep, live, open, greet, now } = page(t);
  live();
  sockets[0].onclose();
  pass(400);
  const [dialled, time_ms, frame] = [sockets.at(-1), now(), store.frame];
  assert.equal(sockets.length, 2);
  sleep();
  open(dialled);
  greet(dialled, time_ms);
  assert.deepEqual([store.isSilent, store.frame === frame], [true, true]);
  pass(400);
  open(sockets.at(-1));
  greet(sockets.at(-1), now() + 60_000);
  assert.equal(store.isSilent, false, 'one that was dialled after the sleep does');
});

test('nor does another connection that was being dialled beside a quiet one', (t) => {
  const { store, sockets, pass, sleep, live, open, greet, now } = page(t);
  live();
  pass(1300);
  const [dialled, time_ms, frame] = [sockets.at(-1), now(), store.frame];
  assert.deepEqual([sockets.length, store.socket.isOpen], [2, true]);
  sleep();
  open(dialled);
  greet(dialled, time_ms);
  assert.deepEqual([store.isSilent, store.frame === frame], [true, true]);
});

test('a page that has shown nothing yet shows nothing of before a sleep either', (t) => {
  const { store, sockets, pass, sleep, open, greet, show, say, now } = page(t);
  pass(400);
  const [dialled, time_ms] = [sockets[0], now()];
  sleep();
  open(dialled);
  greet(dialled, time_ms);
  assert.equal(store.frame, null, 'of a dial of before');
  pass(400);
  open(sockets[1]);
  const opened_ms = now();
  sleep();
  greet(sockets[1], opened_ms + 60_000);
  assert.equal(store.frame, null, 'of a connection that nothing had come over');
  say(sockets[1], { kind: 'offer', seq: 1, of: [], took_ms: now() + 120_000, took: sockets[1].sent.find(({ kind }) => kind === 'take')?.n });
  show(sockets[1], now() + 120_000);
  assert.notEqual(store.frame, null, 'once the server has answered, it does');
});
