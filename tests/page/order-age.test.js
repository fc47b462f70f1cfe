// An order states from which moment its age counts: where the newest state was likely made.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';
import { state } from './frames.js';

const Store = await storeAlone();

/** @type {[string, object, number, number][]} */
const STATES = [
  ['of a server, or of a web node of the version before', {}, 4500, 0.62],
  ['of a web node', { excess_ms: 300 }, 4800, 0.32],
  ['of a web node, whose clock was set since', { excess_ms: 900 }, 5120, 0],
  ['of a web node that lies', { excess_ms: -900 }, 4500, 0.62],
];

for (const [whose, more, made_ms, held_s] of STATES) {
  test(`an order counts from the likely age of a state ${whose}`, (t) => {
    t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
    let now_ms = 1000;
    t.mock.method(performance, 'now', () => now_ms);
    /** @type {any[]} */
    const sent = [];
    const socket = /** @type {any} */ ({ send: (/** @type {string} */ text) => sent.push(JSON.parse(text)), close() {} });
    const store = new Store(() => socket);
    store.painter.picture = store.painter.look = store.painter.draw = () => {};
    store.sync.greet();
    store.start();
    socket.onopen();
    const say = (/** @type {object} */ message) => socket.onmessage({ data: JSON.stringify(message) });
    say({ kind: 'hello', boot: 'a', run: 'a', time_ms: 5000, vehicle: 'car', vehicles: ['car'], build: '', last_event: 0 });
    say({ ...state(), vehicle: 'car', server: { time_ms: 4500, boot: 'a', ...more } });
    now_ms += 120;
    void store.ask('pause');
    store.stop();
    const { heard_ms, held_s: stated_s } = sent.find(({ kind }) => kind === 'pause');
    assert.ok(Math.abs(heard_ms - made_ms) < 1e-6, `${heard_ms}`);
    // a node that compares them with its own clock: an order that is not signed is as old as without the excess
    assert.ok(Math.abs(heard_ms + 1000 * stated_s - 5120) < 1e-6);
    assert.ok(Math.abs(stated_s - held_s) < 1e-9, `${stated_s}`);
  });
}
