// Before its hello, the server does not know who a page is: no command and no status is sent, and no outcome requested.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';

const Store = await storeAlone();
const { Presence } = await import('../../static/js/control/presence.js');
const { FleetStore } = await import('../../static/js/shell/fleet-store.js');

const HELLO = { kind: 'hello', boot: 'a', run: 'a', time_ms: 0, vehicle: 'car', vehicles: ['car'], build: '', last_event: 0 };

/** @type {[string, (dial: () => any) => any][]} */
const PAGES = [
  ['of one car', (dial) => {
    const store = new Store(dial, () => 'Ann', () => 'page-ann');
    store.sync.greet();
    return store;
  }],
  ['of all cars', (dial) => new FleetStore(dial, { name: 'Ann', page: 'page-ann' })],
];

test('what a page of all cars reads after a sleep, before it looks at the time, is covered', (t) => {
  t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  let [now_ms, slept_ms] = [1000, 0];
  t.mock.method(performance, 'now', () => now_ms);
  t.mock.method(Date, 'now', () => now_ms + slept_ms);
  const socket = /** @type {any} */ ({ send() {}, close() {} });
  const store = new FleetStore(() => socket, { name: 'Ann', page: 'page-ann' });
  store.painter.picture = store.painter.look = store.painter.draw = () => {};
  store.start();
  socket.onopen();
  const say = (/** @type {object} */ message) => socket.onmessage({ data: JSON.stringify(message) });
  say(HELLO);
  say({ kind: 'cars', time_ms: 0, cars: [] });
  assert.equal(store.isSilent, false);
  now_ms += 100;
  slept_ms = 60_000;
  say({ kind: 'cars', time_ms: 100, cars: [] }); // it came before the phone slept
  assert.equal(store.isSilent, true);
  store.stop();
});

for (const [name, storeOf] of PAGES) {
  test(`a page ${name} whose command was not answered requests its outcome once it has greeted the next connection`, async (t) => {
    t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
    let now_ms = 1000;
    t.mock.method(performance, 'now', () => now_ms);
    t.mock.method(Date, 'now', () => now_ms);
    /** @type {any[]} */
    const sockets = [];
    const store = storeOf(() => sockets[sockets.push({ sent: [], send(/** @type {string} */ text) { this.sent.push(JSON.parse(text).kind); }, close() {} }) - 1]);
    store.painter.picture = store.painter.look = store.painter.draw = () => {};
    const tick = (/** @type {number} */ ms) => {
      now_ms += ms;
      t.mock.timers.tick(ms);
    };
    const hello = () => sockets.at(-1).onmessage({ data: JSON.stringify(HELLO) });
    store.start();
    sockets[0].onopen();
    hello();
    const answer = store.ask('acknowledge', { vehicle: 'car', alarm: 'speed_limit', occurrence: 1 });
    assert.deepEqual(sockets[0].sent, ['hello', 'acknowledge']);
    sockets[0].onclose();
    assert.equal((await answer).outcome, 'unknown');
    tick(3000);
    assert.equal(sockets.length, 2);
    sockets[1].onopen();
    tick(600); // the page looks several times
    assert.equal((await store.ask('acknowledge', { vehicle: 'car', alarm: 'speed_limit', occurrence: 1 })).outcome, 'not_delivered');
    assert.deepEqual(sockets[1].sent, []);
    hello();
    tick(1600);
    assert.deepEqual(sockets[1].sent, ['hello', 'outcome']);
    store.stop();
  });

  test(`a page ${name} reports how it stands once it has greeted each connection, not before`, (t) => {
    t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
    let now_ms = 1000;
    t.mock.method(performance, 'now', () => now_ms);
    t.mock.method(Date, 'now', () => now_ms);
    /** @type {any[]} */
    const sockets = [];
    const store = storeOf(() => sockets[sockets.push({ sent: [], send(/** @type {string} */ text) { this.sent.push(JSON.parse(text).kind); }, close() {} }) - 1]);
    store.painter.picture = store.painter.look = store.painter.draw = () => {};
    store.start();
    new Presence(store, /** @type {any} */ ({ alarmSound: {}, arms: {} }), /** @type {any} */ ({}), () => []);
    for (const number of [0, 1]) {
      const socket = sockets[number];
      socket.onopen();
      now_ms += 1600;
      t.mock.timers.tick(1600);
      assert.deepEqual(socket.sent, []);
      socket.onmessage({ data: JSON.stringify(HELLO) });
      assert.deepEqual(socket.sent, ['hello', 'present']);
      socket.onclose();
      now_ms += 3000;
      t.mock.timers.tick(3000);
    }
    store.stop();
  });
}
