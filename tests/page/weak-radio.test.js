// The page's own store over modelled radios, in virtual time: what it shows is never younger than it is.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { storeAlone } from './alone.mjs';
import { state } from './frames.js';

const Store = await storeAlone();

/** The least that packets need, what more they may need, and of how many one is repeated after a second. @type {Record<string, [base_ms: number, jitter_ms: number, loss: number]>} */
const RADIOS = { clean: [1, 1, 0], fair: [60, 40, 0.02], weak: [100, 100, 0.05], bad: [200, 200, 0.1] };

/** Bytes on the radio, of a state that is compressed and of any other message. */
const [STATE, SMALL] = [800, 120];

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
  /** What arrived while the phone slept. @type {(() => void)[] | null} */
  held = null;
  slept_ms = 0; // the page's monotonic clock stood still for so long
  frames = 0;
  accepts_ms = 0; // how long the server takes to accept a connection
  every_ms = 100; // from one state to the next
  isFormer = false; // a server that sends nothing ahead
  brokenEvery = Infinity; // so many states one cannot be read
  kbit_s = Infinity; // what each direction carries
  mostUnderWay = 0; // states sent ahead
  /** How long events took that nothing delayed on purpose. @type {number[]} */
  events_ms = [];
  /** Of each state, how old it was when it came. @type {number[]} */
  came_ms = [];

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
    return Math.floor(this.offset_ms + this.slept_ms + this.now_ms * this.drift);
  }

  /** How long a packet and its repetitions are under way. */
  #way_ms() {
    const [base_ms, jitter_ms, loss] = this.radio;
    let way_ms = base_ms + this.random() * jitter_ms;
    for (let wait_ms = 1000; this.random() < loss; wait_ms *= 2) way_ms += wait_ms;
    return way_ms;
  }

  /** A direction of a connection: what is sent arrives in its order, as over TCP, and is repeated while the radio is cut. */
  direction() {
    let [free_ms, carried_ms] = [0, 0];
    /** @type {(() => void)[]} */
    const waiting = [];
    const send = (/** @type {() => void} */ arrive, bytes = SMALL) => {
      carried_ms = Math.max(carried_ms, this.now_ms) + bytes * 8 / this.kbit_s;
      free_ms = Math.max(free_ms, carried_ms + this.#way_ms());
      this.later(free_ms - this.now_ms, () => this.held ? this.held.push(arrive) : arrive());
    };
    const repeat = (/** @type {number} */ after_ms) => this.later(after_ms, () => {
      if (this.isCut) repeat(2 * after_ms);
      else for (const arrive of waiting.splice(0)) send(arrive);
    });
    return (/** @type {() => void} */ arrive, /** @type {number} */ bytes = SMALL) => {
      if (!this.isCut && waiting.length === 0) return send(arrive, bytes);
      if (waiting.push(arrive) === 1) repeat(1000);
    };
  }

  dial() {
    this.#sockets += 1;
    const [up, down] = [this.direction(), this.direction()];
    /** @type {any} */
    const socket = { onopen: null, onmessage: null, isClosed: false, isOffered: 0, made: 0, close() { this.isClosed = true; } };
    const say = (/** @type {object} */ message, bytes = SMALL) => {
      const sent_ms = this.now_ms;
      down(() => {
        if ('events' in message && !socket.isClosed) this.events_ms.push(this.now_ms - sent_ms);
        if ('made_ms' in message && !socket.isClosed) this.came_ms.push(this.now_ms - Number(message.made_ms));
        socket.onmessage?.({ data: JSON.stringify(message) });
      }, bytes);
    };
    const frame = () => ({ ...state(), vehicle: 'car', made_ms: this.now_ms + this.slept_ms, server: { time_ms: this.serverTime(), boot: 'a' } });
    let newest = frame();
    let pushed = newest;
    let [took_ms, took, ahead, pushed_ms, echoed_ms, sent, got] = [0, 0, 0, 0, 0, 0, 0];
    const hasRoom = () => ahead === 0 || sent - got < ahead;
    const mayPush = () => ahead > 0 && hasRoom() && this.now_ms - pushed_ms >= 150;
    const offer = (/** @type {string[]} */ of) => {
      if (of.length === 0) echoed_ms = this.now_ms;
      say({ kind: 'offer', seq: (socket.made += 1), of, took_ms, ...(this.isFormer ? {} : { took }) });
    };
    const push = () => {
      this.frames += 1;
      pushed_ms = this.now_ms;
      pushed = newest;
      sent += 1;
      say(sent % this.brokenEvery === 0 ? { kind: 'state', server: null } : newest, STATE);
      if (ahead) this.mostUnderWay = Math.max(this.mostUnderWay, sent - got);
    };
    const beat = () => {
      if (socket.isClosed) return;
      newest = frame();
      if (mayPush()) push();
      if (!(ahead && hasRoom()) && !socket.isOffered) {
        offer(['state']);
        socket.isOffered = socket.made;
      }
      this.later(this.every_ms, beat);
    };
    socket.send = (/** @type {string} */ text) => up(() => {
      const message = JSON.parse(text);
      if (message.kind !== 'take') return;
      [took_ms, took] = [this.serverTime(), message.n];
      [ahead, got] = this.isFormer ? [0, 0] : [message.ahead ?? 0, message.got ?? got];
      const isTaken = socket.isOffered > 0 && message.seq === socket.isOffered;
      if (isTaken) socket.isOffered = 0;
      if (isTaken ? hasRoom() : mayPush() && newest !== pushed) push();
      if (ahead && this.now_ms - echoed_ms >= 500) offer([]);
    });
    up(() => down(() => up(() => this.later(this.accepts_ms, () => { // the connection, then the request on it
      took_ms = this.serverTime();
      down(() => socket.onopen?.());
      say({ kind: 'hello', boot: 'a', run: 'a', time_ms: this.serverTime(), vehicle: 'car', vehicles: ['car'], build: '', last_event: 0 });
      push();
      this.later(50, beat);
      const event = () => {
        if (!socket.isClosed) say({ kind: 'events', events: [], last: 0 });
        if (!socket.isClosed) this.later(1700, event);
      };
      this.later(1700, event);
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
 * A page before the story's server. `run` lets time pass, with a look at what the page shows ten times a second.
 * @param {import('node:test').TestContext} t
 * @param {Story} story
 */
function page(t, story) {
  t.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
  t.mock.method(performance, 'now', () => story.now_ms);
  t.mock.method(Date, 'now', () => story.now_ms + story.slept_ms);
  t.mock.method(Math, 'random', chance(story.offset_ms));
  const store = new Store(() => story.dial());
  store.vehicle = 'car';
  store.painter.picture = store.painter.look = () => {}; // nothing is drawn here
  /** @type {number[]} */
  const errors_ms = [];
  let [seen, last_ms, beats] = [0, story.now_ms, 0];
  store.on('beat', () => { beats += 1; });
  store.start();
  const look = () => {
    t.mock.timers.tick(Math.round(story.now_ms - last_ms));
    last_ms = story.now_ms;
    const frame = /** @type {any} */ (store.frame);
    seen += 1;
    if (frame && !store.isSilent) errors_ms.push(store.lag_s * 1000 - (story.now_ms + story.slept_ms - frame.made_ms));
  };
  const end = () => {
    store.stop();
    t.mock.timers.reset();
    t.mock.restoreAll();
    return { errors_ms, share: errors_ms.length / seen, beats };
  };
  return { store, look, end, errors_ms, run: (/** @type {number} */ lasts_ms) => story.run(story.now_ms + lasts_ms, look) };
}

/**
 * A minute, with the radio cut now and then; returns what the page showed.
 * @param {import('node:test').TestContext} t
 * @param {Story} story
 */
function watch(t, story) {
  const { run, end } = page(t, story);
  for (let s = 0; s < 60; s += 10) {
    story.isCut = s % 20 === 10 && story.random() < 0.5;
    run(3000);
    story.isCut = false;
    run(7000);
  }
  return end();
}

for (const radio of Object.keys(RADIOS)) {
  test(`over a ${radio} radio no age is shown that is more than 0.2 s too young, from the first frame on`, (t) => {
    for (let seed = 1; seed <= 8; seed += 1) {
      const { errors_ms, share } = watch(t, new Story(radio, seed));
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

for (const [radio, least] of /** @type {[string, number][]} */ ([['fair', 4], ['weak', 3], ['bad', 1]])) {
  test(`over a ${radio} radio states come ahead: more than ${least} a second, and more than one by one`, (t) => {
    const rates = [false, true].map((isFormer) => {
      let beats = 0;
      for (let seed = 1; seed <= 4; seed += 1) {
        const story = new Story(radio, seed);
        story.isFormer = isFormer;
        const { run, end } = page(t, story);
        run(60_000);
        beats += end().beats;
      }
      return beats / 240;
    });
    assert.ok(Number(rates[0]) > least && Number(rates[0]) > 1.2 * Number(rates[1]), String(rates));
  });
}

test('states that cannot be read do not use up how many may be under way', (t) => {
  const story = new Story('fair', 1);
  story.brokenEvery = 5;
  const { run, end, store } = page(t, story);
  run(60_000);
  const { beats } = end();
  assert.ok(store.unreadable > 20 && beats > 120, `${store.unreadable} could not be read, ${beats} could`);
});

/** A minute over a radio that carries little, from the first connection on. @param {import('node:test').TestContext} t @param {number} kbit_s @param {number} seed */
function thin(t, kbit_s, seed) {
  const story = new Story('weak', seed);
  story.radio = [100, 50, 0];
  story.kbit_s = kbit_s;
  const { run, end } = page(t, story);
  run(60_000);
  const { beats, share } = end();
  story.came_ms.sort((a, b) => a - b);
  return { mostUnderWay: story.mostUnderWay, beats, share, middle_ms: Number(story.came_ms[story.came_ms.length >> 1]), oldest_ms: Number(story.came_ms.at(-1)), latest_ms: Math.max(...story.events_ms) };
}

for (const [kbit_s, middle_ms, oldest_ms, share] of /** @type {[number, number, number, number][]} */ ([[8, 1200, 3300, 0.6], [16, 1200, 2000, 0.9], [32, 1000, 1600, 0.9], [64, 600, 1000, 0.9]])) {
  test(`over ${kbit_s} kbit/s no queue of states makes them old, or an event late`, (t) => {
    for (let seed = 1; seed <= 4; seed += 1) {
      const found = thin(t, kbit_s, seed);
      const text = `seed ${seed}: ${JSON.stringify(found)}`;
      assert.ok(found.middle_ms <= middle_ms && found.oldest_ms <= oldest_ms, text);
      assert.ok(found.latest_ms <= oldest_ms && found.share >= share, text);
      assert.ok(found.mostUnderWay <= 12, text);
    }
  });
}

for (const isLookedFirst of [true, false]) test(`what came ahead while the phone slept is not shown, though its clock stood still meanwhile${isLookedFirst ? '' : ', and though it is read before the page looks'}`, (t) => {
  let most = 0;
  for (let seed = 1; seed <= 8; seed += 1) {
    const story = new Story('fair', seed);
    const { run, look, end, errors_ms, store } = page(t, story);
    run(10_000);
    const before = errors_ms.length;
    story.held = [];
    story.run(story.now_ms + 1500, () => {}); // the server sends what it may, and nothing is read
    const held = story.held;
    story.held = null;
    story.slept_ms += 60_000;
    if (isLookedFirst) look(); // the page wakes
    const shown = store.frame;
    for (const arrive of held) arrive();
    assert.equal(store.frame, shown, 'nothing of before the sleep is taken');
    look();
    run(5000);
    most = Math.max(most, held.length);
    assert.ok(errors_ms.length > before + 20, 'then it is live again');
    assert.equal(store.isSilent, false);
    const { errors_ms: all } = end();
    assert.ok(Math.min(...all) >= -200, `seed ${seed}: ${Math.min(...all)} ms`);
  }
  assert.ok(most >= 5, `${most} waited`);
});
