// The page's own store over modelled radios, in virtual time: what it shows is never younger than it is.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';
import { state } from './frames.js';

const Store = await storeAlone();

/** The least that packets need, what more they may need, and of how many one is repeated after a second. @type {Record<string, [base_ms: number, jitter_ms: number, loss: number]>} */
const RADIOS = { clean: [1, 1, 0], fair: [60, 40, 0.02], weak: [100, 100, 0.05], bad: [200, 200, 0.1] };

/** Numbers that look random, the same for each seed. @param {number} seed */
function chance(seed) {
  let at = seed;
  return () => {
    at = (at * 1_664_525 + 1_013_904_223) % 4_294_967_296;
    return at / 4_294_967_296;
  };
}

/** A server behind a radio, and a page before it; all in virtual time. */
class Story {
  now_ms = 1000;
  /** @type {{at_ms: number, run: () => void}[]} */
  #due = [];
  #sockets = 0;
  random;
  isCut = false;
  accepts_ms = 0; // how long the server takes to accept a connection
  every_ms = 100; // from one state to the next

  /** @param {string} radio @param {number} seed */
  constructor(radio, seed) {
    this.random = chance(seed);
    this.radio = RADIOS[radio] ?? [0, 0, 0];
    this.offset_ms = this.random() * 1e9; // of the server's clock
    this.drift = 1 + (this.random() - 0.5) * 1e-4;
  }

  /** @param {number} after_ms @param {() => void} run */
  later(after_ms, run) {
    this.#due.push({ at_ms: this.now_ms + after_ms, run });
  }

  /** The server's time of day. */
  serverTime() {
    return Math.floor(this.offset_ms + this.now_ms * this.drift);
  }

  /** How long a packet and its repetitions are under way. */
  #way_ms() {
    const [base_ms, jitter_ms, loss] = this.radio;
    let way_ms = base_ms + this.random() * jitter_ms;
    for (let wait_ms = 1000; this.random() < loss; wait_ms *= 2) way_ms += wait_ms;
    return way_ms;
  }

  /** A direction of a connection: what is sent arrives in its order, as over TCP. */
  direction() {
    let free_ms = 0;
    return (/** @type {() => void} */ arrive) => {
      free_ms = Math.max(free_ms, this.now_ms + this.#way_ms());
      if (!this.isCut) this.later(free_ms - this.now_ms, arrive);
    };
  }

  dial() {
    this.#sockets += 1;
    const [up, down] = [this.direction(), this.direction()];
    /** @type {any} */
    const socket = { onopen: null, onmessage: null, isClosed: false, isOffered: false, made: 0, close() { this.isClosed = true; } };
    const say = (/** @type {object} */ message) => down(() => socket.onmessage?.({ data: JSON.stringify(message) }));
    const frame = () => ({ ...state(), vehicle: 'car', made_ms: this.now_ms, server: { time_ms: this.serverTime(), boot: 'a' } });
    let newest = frame();
    let took_ms = 0;
    const beat = () => {
      if (socket.isClosed) return;
      newest = frame();
      if (!socket.isOffered) say({ kind: 'offer', seq: (socket.made += 1), of: ['state'], took_ms });
      socket.isOffered = true;
      this.later(this.every_ms, beat);
    };
    socket.send = (/** @type {string} */ text) => up(() => {
      if (JSON.parse(text).kind !== 'take') return;
      socket.isOffered = false;
      took_ms = this.serverTime();
      say(newest);
    });
    up(() => down(() => up(() => this.later(this.accepts_ms, () => { // the connection, then the request on it
      took_ms = this.serverTime();
      down(() => socket.onopen?.());
      say({ kind: 'hello', boot: 'a', run: 'a', time_ms: this.serverTime(), vehicle: 'car', vehicles: ['car'], build: '', last_event: 0 });
      say(newest);
      this.later(50, beat);
    }))));
    return socket;
  }

  /** Run what is due until then, and look ten times a second. @param {number} until_ms @param {() => void} look */
  run(until_ms, look) {
    const looking = () => {
      look();
      if (this.now_ms < until_ms) this.later(100, looking);
    };
    this.later(0, looking);
    while (this.#due.length && this.now_ms < until_ms) {
      let next = 0;
      this.#due.forEach(({ at_ms }, i) => { if (at_ms < Number(this.#due[next]?.at_ms)) next = i; });
      const [{ at_ms, run } = { at_ms: 0, run: () => {} }] = this.#due.splice(next, 1);
      this.now_ms = Math.max(this.now_ms, at_ms);
      run();
    }
  }
}

/**
 * A minute, with the radio cut now and then; returns what the page showed.
 * @param {import('node:test').TestContext} t
 * @param {Story} story
 */
function watch(t, story) {
  t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  t.mock.method(performance, 'now', () => story.now_ms);
  const store = new Store(() => story.dial());
  store.vehicle = 'car';
  store.painter.picture = store.painter.look = () => {}; // nothing is drawn here
  const errors_ms = [];
  let [seen, shown, last_ms] = [0, 0, 0];
  store.start();
  const look = () => {
    t.mock.timers.tick(Math.round(story.now_ms - last_ms));
    last_ms = story.now_ms;
    const frame = /** @type {any} */ (store.frame);
    seen += 1;
    if (!frame || store.isSilent) return;
    shown += 1;
    errors_ms.push(store.lag_s * 1000 - (story.now_ms - frame.made_ms));
  };
  last_ms = story.now_ms;
  for (let s = 0; s < 60; s += 10) {
    story.isCut = s % 20 === 10 && story.random() < 0.5;
    story.run(story.now_ms + 3000, look);
    story.isCut = false;
    story.run(story.now_ms + 7000, look);
  }
  store.stop();
  t.mock.timers.reset();
  return { errors_ms, share: shown / seen };
}

for (const radio of Object.keys(RADIOS)) {
  test(`over a ${radio} radio no age is shown that is more than 0.2 s too young, from the first frame on`, (t) => {
    for (let seed = 1; seed <= 8; seed += 1) {
      const { errors_ms, share } = watch(t, new Story(radio, seed));
      t.mock.restoreAll();
      assert.ok(Math.min(...errors_ms) >= -200, `seed ${seed}: ${Math.min(...errors_ms)} ms`);
      const middle_ms = errors_ms.sort((a, b) => a - b)[errors_ms.length >> 1] ?? Infinity;
      assert.ok(middle_ms <= 200, `seed ${seed}: ${middle_ms} ms too old`);
      assert.ok(share > (radio === 'bad' ? 0.3 : 0.6), `seed ${seed}: ${share} of the time live`);
    }
  });
}

test('a page comes live though each connection takes the server long, and its first frames look too old', (t) => {
  const story = new Story('fair', 2);
  story.accepts_ms = 2600;
  story.every_ms = 1100; // a server that is busy
  const { share } = watch(t, story);
  assert.ok(share > 0.3, `${share} of the time live`);
});

test('a server that took long to accept makes the first frame look old, and no other', (t) => {
  const story = new Story('fair', 1);
  story.accepts_ms = 4200;
  const { errors_ms, share } = watch(t, story);
  assert.ok(Math.min(...errors_ms) >= -200);
  assert.ok(share > 0.6, `${share} of the time live`);
});
