import assert from 'node:assert/strict';
import { test } from 'node:test';
import { PageSocket } from '../../static/js/core/socket.js';
import { Store } from '../../static/js/core/store.js';
import { ReplayLead } from '../../static/js/replay/replay-lead.js';
import { recordedLines } from '../../static/js/replay/recorded-log.js';
import { tapeWords } from '../../static/js/replay/replay-layout.js';

const SEC_MS = 1000;
const A_SECOND = 25;

/** @param {number[]} times_ms in order @returns {number} the most of them within any second */
const mostInASecond = (times_ms) => Math.max(0, ...times_ms.map((from_ms) => times_ms.filter((at_ms) => at_ms >= from_ms && at_ms < from_ms + SEC_MS).length));

/** A store whose socket is open, on a clock of the test. @param {import('node:test').TestContext} t */
function opened(t) {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  let now_ms = 0;
  t.mock.method(performance, 'now', () => now_ms);
  /** @type {{at_ms: number, kind: string, do?: string}[]} */
  const sent = [];
  const socket = /** @type {any} */ ({ send: (/** @type {string} */ text) => sent.push({ at_ms: now_ms, ...JSON.parse(text) }), close() {} });
  const store = new Store(() => socket);
  store.sync.greet();
  store.socket.look(0);
  socket.onopen();
  socket.onmessage({ data: JSON.stringify({ kind: 'hello', boot: 'a', run: 'a', time_ms: 0 }) });
  sent.length = 0;
  const pass = async (/** @type {number} */ ms) => {
    for (const end_ms = now_ms + ms; now_ms < end_ms; ) {
      now_ms += 1;
      t.mock.timers.tick(1);
      for (let i = 0; i < 4; i += 1) await null; // what was waited for
    }
  };
  return { store, socket, sent, pass };
}

for (const [what, offers] of /** @type {const} */ ([['offers what it does not send', 1], ['offers three frames at once', 3]])) {
  test(`a page of a server that ${what} sends at most ${A_SECOND} messages a second, and takes to the end`, async (t) => {
    const { socket, sent, pass } = opened(t);
    let seq = 0;
    let answered = 0;
    for (let ms = 0; ms < 4000; ms += 1) {
      if (seq === 0 || sent.length > answered) {
        answered = sent.length;
        for (let i = 0; i < offers; i += 1) socket.onmessage({ data: JSON.stringify({ kind: 'offer', seq: (seq += 1), of: ['scan'] }) });
      }
      await pass(1);
    }
    assert.ok(mostInASecond(sent.map(({ at_ms }) => at_ms)) <= A_SECOND, String(sent.length));
    assert.ok(sent.length >= 60, `${sent.length}: frames are taken as fast as that`);
  });
}

test('a replay that is dragged while it plays keeps the bound, and an order of a person never waits', async (t) => {
  const { store, socket, sent, pass } = opened(t);
  const lead = new ReplayLead(store);
  let answered = 0;
  let seq = 0;
  const isLed = (async () => {
    for (let i = 0; i < 40; i += 1) await lead.order({ do: 'seek', at_s: i });
  })();
  for (let ms = 0; ms < 4000; ms += 10) {
    socket.onmessage({ data: JSON.stringify({ kind: 'offer', seq: (seq += 1), of: ['state'] }) });
    for (const one of sent.slice(answered)) if ('id' in one) socket.onmessage({ data: JSON.stringify({ kind: 'reply', id: one.id, ok: true }) });
    answered = sent.length;
    await pass(10);
  }
  assert.ok(mostInASecond(sent.map(({ at_ms }) => at_ms)) <= A_SECOND);
  assert.ok(sent.filter((one) => one.do === 'seek').length >= 10, 'the picture follows the finger');
  const before = sent.length;
  for (let i = 0; i < 5; i += 1) void store.ask('release', { number: 1, vehicle: null });
  assert.equal(sent.length, before + 5);
  void isLed;
});

for (const each_ms of [2, 10, 35]) {
  test(`a scrubber that is dragged without end leaves room for the frames: answers each ${each_ms} ms`, async (t) => {
    const { store, socket, sent, pass } = opened(t);
    const lead = new ReplayLead(store);
    let isDragged = true;
    let answered = 0;
    let seq = 0;
    void (async () => {
      for (let i = 0; isDragged; i += 1) await lead.order({ do: 'seek', at_s: i });
    })();
    for (let ms = 0; ms < 6000; ms += each_ms) {
      socket.onmessage({ data: JSON.stringify({ kind: 'offer', seq: (seq += 1), of: ['state'] }) });
      for (const one of sent.slice(answered)) if ('id' in one) socket.onmessage({ data: JSON.stringify({ kind: 'reply', id: one.id, ok: true }) });
      answered = sent.length;
      await pass(each_ms);
    }
    isDragged = false;
    const takes_ms = sent.filter(({ kind }) => kind === 'take').map(({ at_ms }) => at_ms);
    const seeks_ms = sent.filter((one) => one.do === 'seek').map(({ at_ms }) => at_ms);
    assert.ok(mostInASecond(sent.map(({ at_ms }) => at_ms)) <= A_SECOND);
    assert.ok(Math.max(...takes_ms.slice(1).map((at_ms, n) => at_ms - (takes_ms[n] ?? 0))) <= 220, `takes at ${takes_ms}`);
    assert.ok(takes_ms.length >= 6 * 15, `${takes_ms.length} takes`);
    assert.ok(seeks_ms.length >= 6 * 4 && mostInASecond(seeks_ms) <= 8, `${seeks_ms.length} seeks`);
  });
}

test('messages of another second count no more', (t) => {
  let now_ms = 0;
  t.mock.timers.enable({ apis: ['setTimeout'] });
  t.mock.method(performance, 'now', () => now_ms);
  const socket = /** @type {any} */ ({ send() {}, close() {} });
  const page = new PageSocket({ opened() {}, closed() {}, text() {}, bytes() {} }, () => socket);
  page.look(0);
  socket.onopen();
  let ran = 0;
  const request = (/** @type {number} */ most) => page.inTurn(most, () => { ran += 1; });
  for (let i = 0; i < 3; i += 1) page.send({ kind: 'take', seq: i });
  request(4);
  assert.equal(ran, 1);
  request(3);
  now_ms = 999;
  t.mock.timers.tick(999);
  assert.equal(ran, 1);
  now_ms = 1000;
  t.mock.timers.tick(1);
  assert.equal(ran, 2);
});

/** A store whose connection the test breaks and mends. */
function breakable() {
  const orders = /** @type {any[]} */ ([]);
  const store = /** @type {any} */ ({
    socket: { isOpen: true, inTurn: (/** @type {number} */ _, /** @type {() => void} */ run) => run() },
    ask: (/** @type {string} */ _, /** @type {any} */ order) => new Promise((resolve) => orders.push({ ...order, resolve })),
  });
  const turn = () => new Promise((resolve) => setImmediate(resolve));
  return { store, orders, turn, lead: new ReplayLead(store) };
}

test('the next alarm that is pressed while the connection is opened again is gone to once the recording is shown again', async () => {
  const { store, orders, turn, lead } = breakable();
  store.socket.isOpen = false;
  const answer = lead.order({ do: 'seek', at_s: 60 });
  await turn();
  assert.deepEqual(orders, [], 'no server to send to');
  store.socket.isOpen = true;
  /** @type {(answer: {ok: boolean}) => void} */
  let open = () => {};
  const reopened = lead.reopen(() => new Promise((resolve) => { open = resolve; }));
  await turn();
  assert.deepEqual(orders, [], 'it shows no replay yet');
  open({ ok: true });
  await reopened;
  await turn();
  assert.equal(orders[0].at_s, 60);
  orders[0].resolve({ ok: true });
  assert.deepEqual(await answer, { ok: true });
});

test('an order that met a server that had just started is given again, and one that is refused is not', async () => {
  const { orders, turn, lead } = breakable();
  const answer = lead.order({ do: 'play' });
  await turn();
  /** @type {(answer: {ok: boolean}) => void} */
  let open = () => {};
  const reopened = lead.reopen(() => new Promise((resolve) => { open = resolve; }));
  orders[0].resolve({ ok: false, reason: 'This page shows no replay.' });
  await turn();
  open({ ok: true });
  await reopened;
  await turn();
  assert.equal(orders.length, 2);
  orders[1].resolve({ ok: false, reason: 'Too many commands at once from this page: wait a second.' });
  assert.equal((await answer).ok, false);
  assert.equal(orders.length, 2);
});

test('a connection that breaks while the recording is opened again keeps the order; a replay that is left drops it', async () => {
  const { store, orders, turn, lead } = breakable();
  store.socket.isOpen = false;
  const answer = lead.order({ do: 'seek', at_s: 9 });
  await lead.reopen(async () => ({ ok: false, isBroken: true }));
  await turn();
  assert.deepEqual(orders, []);
  lead.end();
  assert.deepEqual(await answer, { ok: true });
  assert.deepEqual(orders, []);
});

test('another connection that takes the place of the one over which the recording is opened again keeps the order', async () => {
  const { orders, turn, lead } = breakable();
  /** @type {((answer: {ok: boolean, isBroken?: boolean}) => void)[]} */
  const opens = [];
  const reopen = () => lead.reopen(() => new Promise((resolve) => opens.push(resolve)));
  void reopen();
  const answer = lead.order({ do: 'seek', at_s: 9 });
  opens[0]?.({ ok: false, isBroken: true });
  void reopen(); // the other one is open at once
  await turn();
  assert.deepEqual(orders, []);
  opens[1]?.({ ok: true });
  await turn();
  assert.equal(orders[0].at_s, 9);
  orders[0].resolve({ ok: true });
  assert.deepEqual(await answer, { ok: true });
});

test('an answer that a connection took with it when it broke is none of the server', async (t) => {
  const { store, socket, pass } = opened(t);
  const answer = store.ask('replay', { do: 'play' });
  socket.onclose();
  assert.equal((await answer).isBroken, true);
  assert.equal((await store.ask('replay', { do: 'play' })).isBroken, true);
  store.socket.look(10_000);
  socket.onopen();
  socket.onmessage({ data: JSON.stringify({ kind: 'hello', boot: 'a', run: 'a', time_ms: 0 }) });
  const late = store.ask('replay', { do: 'play' });
  await pass(4001);
  assert.equal((await late).isBroken, undefined, 'not in time');
});

const alarm = (/** @type {number} */ at_s, /** @type {object} */ more = {}) => ({ at_s, alarm: 'speed_limit', title: 'Speed above limit', priority: 'critical', text: '12.4 m/s', duration_s: 8, ...more });
const line = (/** @type {object} */ more = {}) => /** @type {any} */ ({ marks: [alarm(20), alarm(50, { title: 'GPS drift', priority: 'warning', duration_s: null })], marks_left_out: 0, gaps: [[40, 46]], flags: [], interventions: [], is_done: true, done_s: 70, ...more });
const titles = (/** @type {any} */ of, /** @type {number} */ at_s) => recordedLines(of, { at_s, start_ms: 1_000_000 }).map(({ title }) => title);

test('the log beside a replay is that of the recording up to the moment that is shown, newest first', () => {
  assert.deepEqual(titles(line(), 10), []);
  assert.deepEqual(titles(line(), 24), ['Speed above limit']);
  assert.deepEqual(titles(line(), 43), ['Nothing recorded', 'Speed above limit: ended', 'Speed above limit']);
  assert.deepEqual(titles(line(), 70), ['GPS drift', 'Nothing recorded: ended', 'Nothing recorded', 'Speed above limit: ended', 'Speed above limit']);
  const [first] = recordedLines(line(), { at_s: 24, start_ms: 1_000_000 });
  assert.deepEqual(first, { at_ms: 1_020_000, icon: 'crit', kind: 'c-crit', title: 'Speed above limit', text: '12.4 m/s', priority: 'critical' });
});

test('what of a recording is not read or not listed is stated in its log', () => {
  assert.deepEqual(titles(null, 24), ['The recording is being read']);
  assert.deepEqual(titles(line({ is_done: false, done_s: 30 }), 24), ['Speed above limit']);
  assert.deepEqual(titles(line({ is_done: false, done_s: 22 }), 24), ['Not read yet', 'Speed above limit']);
  assert.deepEqual(titles(line({ marks_left_out: 3 }), 24), ['3 more alarms not listed', 'Speed above limit']);
});

test('the tape reads as a part of a length, never as a time of day', () => {
  assert.equal(tapeWords({ at_s: 246, length_s: 1071 }), '04:06 of 17:51');
  assert.equal(tapeWords({ at_s: 0, length_s: 7200 }), '00:00 of 2:00:00');
});
