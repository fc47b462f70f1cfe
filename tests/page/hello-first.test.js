// Before its hello, the server does not know who a page is: no command is sent, and none is asked about.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';

const Store = await storeAlone();
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

for (const [name, storeOf] of PAGES) {
  test(`a page ${name} whose command was not answered asks for its outcome once it has greeted the next connection`, async (t) => {
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
    const asked = store.ask('acknowledge', { vehicle: 'car', alarm: 'speed_limit', occurrence: 1 });
    assert.deepEqual(sockets[0].sent, ['hello', 'acknowledge']);
    sockets[0].onclose();
    assert.equal((await asked).outcome, 'unknown');
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
}
