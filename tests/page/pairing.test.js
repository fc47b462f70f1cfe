// The texts of the pairing screen and the list of devices; where a link may lead.

import assert from 'node:assert/strict';
import { readdir, readFile } from 'node:fs/promises';
import { test } from 'node:test';

globalThis.location ??= /** @type {any} */ ({ hash: '', pathname: '/', search: '', origin: 'https://192.168.4.1:8000' });
globalThis.window ??= /** @type {any} */ ({ addEventListener() {} });

const { digitsOf, pinShown, reasonWords, triedWords, waitWords } = await import('../../static/js/pairing/pairing-layout.js');
const { leftWords, removalWords, seenWords } = await import('../../static/js/pairing/devices-layout.js');
const { thenOf } = await import('../../static/js/boot/pairing-token.js');
const { forgetWork, OF_THE_WORK } = await import('../../static/js/boot/forget.js');
const { Admission } = await import('../../static/js/pairing/admission.js');
const { PageSocket } = await import('../../static/js/core/socket.js');
const { screenOf } = await import('../../static/js/shell/router.js');

test('the next socket has the ticket that the one before brought, until the server refuses it', async (t) => {
  /** @type {any[]} */
  const dialled = [];
  t.mock.method(globalThis, 'fetch', async () => ({ ok: true, json: async () => ({ ticket: `fetched ${dialled.length}` }) }));
  t.after(() => { delete /** @type {any} */ (globalThis).WebSocket; });
  globalThis.WebSocket = /** @type {any} */ (class {
    /** @param {string} address */
    constructor(address) {
      this.address = address;
      dialled.push(this);
    }

    close() {}
  });
  const admission = new Admission(() => 'ws://car/ws', () => {});
  const closed = /** @type {string[]} */ ([]);
  const dial = async () => {
    const socket = admission.dial(null);
    Object.assign(socket, { onclose: () => closed.push('closed') });
    await new Promise((resolve) => { setTimeout(resolve); });
    return socket;
  };
  await dial();
  dialled[0].onopen();
  admission.greeted(/** @type {any} */ ({ ticket: 'next' }));
  dialled[0].onclose();
  (await dial()).close(); // given up: no answer came
  dialled[1].onclose();
  await dial();
  dialled[2].onclose(); // refused
  await dial();
  assert.deepEqual(dialled.map(({ address }) => decodeURIComponent(address.split('ticket=')[1])), ['fetched 0', 'next', 'next', 'fetched 3']);
  assert.equal(closed.length, 3);
});

test('a connection that was dialled beside a quiet one and is not needed brings the ticket of the next one', async (t) => {
  /** @type {any[]} */
  const dialled = [];
  t.mock.method(globalThis, 'fetch', async () => ({ ok: true, json: async () => ({ ticket: 'fetched' }) }));
  t.after(() => { delete /** @type {any} */ (globalThis).WebSocket; });
  globalThis.WebSocket = /** @type {any} */ (class {
    /** @param {string} address */
    constructor(address) {
      this.ticket = new URL(address).searchParams.get('ticket');
      dialled.push(this);
    }

    close() {}
  });
  const admission = new Admission(() => 'ws://car/ws', () => {});
  let now_ms = 0;
  t.mock.method(performance, 'now', () => now_ms);
  const listener = { opened() {}, closed() {}, text() {}, bytes() {} };
  const page = new PageSocket(listener, () => admission.dial(page.trip), () => now_ms, () => 0);
  const look = async (/** @type {number} */ until_ms) => {
    for (; now_ms < until_ms; now_ms += 100) page.look(now_ms);
    await new Promise((resolve) => { setTimeout(resolve); });
  };
  const hello = (/** @type {string} */ ticket) => ({ data: JSON.stringify({ kind: 'hello', boot: 'a', time_ms: 0, ticket }) });
  await look(100);
  await look(400);
  dialled[0].onopen();
  dialled[0].onmessage(hello('first'));
  page.offered(/** @type {any} */ ({ seq: 1, of: ['state'], took: 0 }), 500); // a slow radio
  await look(1600);
  page.proof(now_ms); // it answers while the other one is under way
  dialled[1].onopen();
  dialled[1].onmessage(hello('second'));
  dialled[0].onclose();
  await look(2200);
  assert.deepEqual(dialled.map(({ ticket }) => ticket), ['fetched', 'first', 'second']);
  dialled[2].onopen();
  dialled[2].onclose(); // a server that refuses it after it opened
  await look(5000);
  assert.equal(dialled[3].ticket, 'fetched');
});

test('a ticket is used up once its socket has opened, also where the server then greets nobody', async (t) => {
  /** @type {any[]} */
  const dialled = [];
  t.mock.method(globalThis, 'fetch', async () => ({ ok: true, json: async () => ({ ticket: 'fetched' }) }));
  t.after(() => { delete /** @type {any} */ (globalThis).WebSocket; });
  globalThis.WebSocket = /** @type {any} */ (class {
    /** @param {string} address */
    constructor(address) {
      this.ticket = new URL(address).searchParams.get('ticket');
      dialled.push(this);
    }

    close() {}
  });
  const admission = new Admission(() => 'ws://car/ws', () => {});
  admission.greeted(/** @type {any} */ ({ ticket: 'brought' }));
  const dial = async () => {
    const socket = admission.dial(null);
    await new Promise((resolve) => { setTimeout(resolve); });
    return socket;
  };
  const spare = await dial();
  dialled[0].onopen();
  dialled[0].onmessage({ data: JSON.stringify({ kind: 'unserved', why: 'The agent is not there.' }) });
  spare.close();
  await dial();
  assert.deepEqual(dialled.map(({ ticket }) => ticket), ['brought', 'fetched']);
});

test('a PIN is its digits, however it is typed', () => {
  for (const [typed, digits, shown] of [['', '', ''], ['12', '12', '12'], ['123', '123', '123'], ['123 4', '1234', '123 4'], ['12-34-56-78', '123456', '123 456'], ['a1', '1', '1']]) {
    assert.equal(digitsOf(typed), digits);
    assert.equal(pinShown(digitsOf(typed)), shown);
  }
});

test('the reason of a refused admission is shown as text', () => {
  assert.equal(reasonWords({ code: 'unpaired', detail: 'x' }), '');
  assert.equal(reasonWords({}), '');
  assert.equal(reasonWords({ code: 'removed', detail: 'This device was removed by Ann.' }), 'This device was removed by Ann.');
  assert.deepEqual(triedWords(403, { code: 'wrong', wait_s: 1.2 }), { sentence: 'This PIN is wrong. Read it again from the server.', wait_s: 2, isLinkOver: false });
  assert.equal(triedWords(403, { code: 'used' }).isLinkOver, true);
  assert.match(triedWords(429, { code: 'wait', wait_s: 8 }).sentence, /^Too many wrong PINs/);
  assert.match(triedWords(403, { code: 'expired' }).sentence, /10 minutes/);
  assert.match(triedWords(0, {}).sentence, /does not answer/);
  assert.equal(triedWords(503, { detail: 'The disk is full.' }).sentence, 'The disk is full.');
  assert.equal(triedWords(500, {}).sentence, 'The server refused (500).');
  assert.equal(waitWords(1), 'Wait 1 second');
  assert.equal(waitWords(30), 'Wait 30 seconds');
});

test('a device is here now, or was', () => {
  const now_ms = 1_790_000_000_000;
  const ago = (/** @type {number} */ s, sockets = 0) => seenWords({ seen_ms: now_ms - s * 1000, sockets }, now_ms);
  assert.equal(ago(9999, 1), 'here now');
  assert.equal(ago(-50), 'here a moment ago');
  assert.equal(ago(119), 'here a moment ago');
  assert.equal(ago(120), 'seen 2 minutes ago');
  assert.equal(ago(3600), 'seen 1 hour ago');
  assert.equal(ago(86_400 * 3), 'seen 3 days ago');
});

test('a removal names whose pages end, and that the last operator goes', () => {
  const device = (/** @type {string} */ id, /** @type {'viewer' | 'operator'} */ role) => ({ id, name: id, role, paired_ms: 0, seen_ms: 0, sockets: 0 });
  const [a, b] = [device('a', 'operator'), device('b', 'viewer')];
  assert.equal(removalWords(b, 'a', [a, b])[0], 'Remove b?');
  assert.doesNotMatch(removalWords(b, 'a', [a, b])[1], /last operator/);
  assert.equal(removalWords(a, 'a', [a, b])[0], 'Remove this device?');
  assert.match(removalWords(a, 'a', [a, b])[1], /last operator/);
  assert.doesNotMatch(removalWords(a, 'b', [a, device('c', 'operator')])[1], /last operator/);
});

test('what is left of an invitation', () => {
  assert.deepEqual([600, 599.2, 61, 59.01, 0, -3].map(leftWords), ['10:00', '10:00', '1:01', '1:00', '0:00', '0:00']);
});

test('a link leads only to what this server has itself', () => {
  const here = 'https://192.168.4.1:8000';
  assert.equal(thenOf('/api/recordings/drive%201/file.mcap?a=b', here), '/api/recordings/drive%201/file.mcap?a=b');
  assert.equal(thenOf('/docs', here), '/docs');
  for (const then of [null, '', 'https://evil.example/', '//evil.example/api/', '/\\evil.example', '/api', 'javascript:alert(1)', '/static/x', 'api/x', '/docs.evil', '/@evil.example/api/']) {
    assert.equal(thenOf(then, here), null, String(then));
  }
  assert.equal(thenOf('/api/../static/x', here), '/static/x'); // of this server all the same
});

test('who is not paired sees nothing else', () => {
  const watching = /** @type {any} */ ({ frame: {}, isMonitoring: true });
  assert.equal(screenOf(watching, false, true), 'pairing');
  assert.equal(screenOf(watching, false), 'monitor');
});

test('a device that was removed forgets cars and people, and keeps how its owner likes to look', () => {
  const all = new Map([...OF_THE_WORK, 'theme', 'hand', 'speed-unit'].map((name) => [`catgraph.${name}`, 'x']));
  forgetWork({ removeItem: (key) => { all.delete(key); } });
  assert.deepEqual([...all.keys()], ['catgraph.theme', 'catgraph.hand', 'catgraph.speed-unit']);
  forgetWork(null);
  forgetWork({ removeItem: () => { throw new Error('refused'); } });
});

test('whatever a page keeps is either forgotten, or is of the phone alone', async () => {
  const OF_THE_PHONE = ['device', 'range', 'speed-unit', 'tab', 'theme', 'hand', 'keys', 'trends', 'clock-ahead'];
  const OF_THE_TAB = ['phone', 'armed', 'asked-duty']; // gone with it
  const folder = new URL('../../static/js/', import.meta.url);
  const texts = await Promise.all((await readdir(folder, { recursive: true })).filter((name) => name.endsWith('.js')).map((name) => readFile(new URL(name, folder), 'utf8')));
  const kept = new Set(texts.flatMap((text) => [...text.matchAll(/'catgraph\.([a-z-]+)'/g)].map(([, name]) => name)));
  assert.deepEqual([...kept].sort(), [...OF_THE_WORK, ...OF_THE_PHONE, ...OF_THE_TAB].sort());
});
