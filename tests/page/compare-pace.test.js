// The time line of two recordings leads both: with a server that is simulated, and time as an argument.

import assert from 'node:assert/strict';
import test from 'node:test';

import { Pace } from '../../static/js/replay/compare-pace.js';

const FRAME_S = 0.1;

/** Two replays as the server plays them, each at most `most` times as fast as it is recorded. */
class Server {
  now_ms = 0;
  /** @type {string[]} */
  orders = [];
  /** @type {string | null} */
  refuses = null;
  /** @type {string[]} */
  messages = [];

  /** @param {{a: number, b: number}} lengths @param {{a: number, b: number}} most */
  constructor(lengths, most = { a: Infinity, b: Infinity }) {
    const replay = (/** @type {'a' | 'b'} */ name) => ({ token: name, length_s: lengths[name], at_s: 0, start_ms: 0, is_playing: false, is_seeking: false, rate: 1, reached_rate: /** @type {number | null} */ (null) });
    this.replays = { a: replay('a'), b: replay('b') };
    this.most = most;
    this.pace = new Pace(/** @type {any} */ ({ now: () => this.now_ms, ask: (/** @type {string} */ _, /** @type {any} */ order) => this.ask(order) }), (sentence) => this.messages.push(sentence));
  }

  /** @param {any} order */
  async ask(order) {
    const name = order.beside ? 'b' : 'a';
    const replay = this.replays[/** @type {'a' | 'b'} */ (name)];
    this.orders.push(`${name} ${order.do}${order.at_s === undefined ? '' : ` ${order.at_s}`}`);
    await new Promise((resolve) => { setImmediate(resolve); });
    if (this.refuses) return { ok: false, reason: this.refuses };
    if (order.do === 'seek') replay.at_s = order.at_s;
    else if (order.do === 'rate') replay.rate = order.rate;
    else replay.is_playing = order.do === 'play';
    return { ok: true };
  }

  /** Frames of both for so long [s]. @param {number} seconds */
  async run(seconds) {
    for (let n = 0; n < Math.round(seconds / FRAME_S); n += 1) {
      this.now_ms += FRAME_S * 1000;
      for (const name of /** @type {const} */ (['a', 'b'])) {
        const replay = this.replays[name];
        if (replay.is_playing) {
          replay.at_s = Math.min(replay.length_s, replay.at_s + Math.min(replay.rate, this.most[name]) * FRAME_S);
          replay.reached_rate = replay.rate > this.most[name] ? this.most[name] : null;
          if (replay.at_s >= replay.length_s) replay.is_playing = false;
        }
        this.pace.take(name, /** @type {any} */ ({ ...replay }));
        await new Promise((resolve) => { setImmediate(resolve); });
      }
    }
  }

  async begin() {
    await this.run(0.2);
    this.pace.wake();
    await this.run(0.5);
  }

  /** How far B is from where the time line has A [s]. */
  get apart_s() {
    return Math.abs(this.replays.b.at_s + this.pace.shift_s - this.replays.a.at_s);
  }
}

test('what A shows counts when the comparison comes in sight, and B follows', async () => {
  const server = new Server({ a: 60, b: 60 });
  server.replays.a.at_s = 12;
  await server.begin();
  assert.equal(server.pace.at_s, 12);
  assert.equal(server.replays.b.at_s, 12);
});

test('both play from one key, and stand at the same moment after the next', async () => {
  const server = new Server({ a: 60, b: 60 });
  await server.begin();
  server.pace.setRate(4);
  server.pace.toggle();
  await server.run(3);
  assert.ok(server.replays.a.at_s > 8, `${server.replays.a.at_s}`);
  assert.equal(server.orders.filter((order) => order === 'a rate').length, 1, 'an order that was executed is not repeated');
  assert.ok(server.apart_s < 1, `${server.apart_s}`);
  server.pace.toggle();
  await server.run(1);
  assert.ok(server.apart_s <= 0.03, `${server.apart_s}`);
  assert.deepEqual([server.replays.a.is_playing, server.replays.b.is_playing], [false, false]);
});

test('B begins where the time line comes to its beginning, and leads on after the end of A', async () => {
  const server = new Server({ a: 6, b: 6 });
  await server.begin();
  server.pace.setShift(3);
  server.pace.toggle();
  await server.run(2);
  assert.equal(server.replays.b.is_playing, false);
  assert.equal(server.replays.b.at_s, 0);
  await server.run(2.5);
  assert.ok(server.replays.b.is_playing && server.replays.a.is_playing);
  assert.ok(server.apart_s < 0.5, `${server.apart_s}`);
  await server.run(3);
  assert.ok(server.replays.a.at_s > 5.99);
  assert.ok(server.replays.b.is_playing, 'A is over, B is not');
  assert.ok(server.pace.at_s > 6.5);
  await server.run(3);
  assert.equal(server.pace.isPlaying, false);
  assert.deepEqual([server.replays.a.is_playing, server.replays.b.is_playing], [false, false]);
  assert.equal(server.orders.filter((order) => order === 'b play').length, 1, `played at its end it would begin anew: ${server.orders}`);
});

test('where A cannot keep the pace, B waits for it', async () => {
  const server = new Server({ a: 100, b: 100 }, { a: 2, b: Infinity });
  await server.begin();
  server.pace.setRate(8);
  server.pace.toggle();
  await server.run(5);
  assert.ok(Math.abs(server.pace.at_s - server.replays.a.at_s) < 1, `${server.pace.at_s}`);
  assert.ok(server.apart_s < 8 * 0.15 + 0.25 + 8 * 0.6, `${server.apart_s}`);
});

test('a moment that was sought is not given up for a frame of before', async () => {
  const server = new Server({ a: 60, b: 60 });
  await server.begin();
  server.pace.toggle();
  await server.run(1);
  server.pace.seek(40);
  server.pace.take('a', /** @type {any} */ ({ ...server.replays.a, at_s: 1 }));
  assert.equal(server.pace.at_s, 40);
  await server.run(1);
  assert.ok(server.replays.a.at_s > 40 && server.replays.b.at_s > 40);
});

test('a refused order is shown once, and the time line stands', async () => {
  const server = new Server({ a: 60, b: 60 });
  await server.begin();
  server.refuses = 'No.';
  server.pace.toggle();
  await server.run(0.1);
  assert.equal(server.pace.isPlaying, false);
  assert.ok(server.messages.includes('No.'));
});

test('out of sight nothing is ordered', async () => {
  const server = new Server({ a: 60, b: 60 });
  await server.begin();
  server.pace.sleep();
  server.orders.length = 0;
  server.replays.a.at_s = 33;
  await server.run(1);
  assert.deepEqual(server.orders, []);
  server.pace.wake();
  await server.run(0.3);
  assert.equal(server.replays.b.at_s, 33);
});
