import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readMessage } from '../../static/js/core/protocol.js';
import { PageSocket } from '../../static/js/core/socket.js';

const HELLO = JSON.stringify({ kind: 'hello', boot: 'a', time_ms: 0 });

/** A socket as a browser has it, moved by the test. */
class Socket {
  /** @type {string[]} */
  sent = [];
  isClosed = false;
  /** @type {any} */
  onopen = null;
  /** @type {any} */
  onmessage = null;
  /** @type {any} */
  onclose = null;

  /** @param {string} text */
  send(text) {
    this.sent.push(text);
  }

  close() {
    this.isClosed = true;
  }
}

function set() {
  let now_ms = 0;
  const chance = { now: 0 };
  /** @type {Socket[]} */
  const sockets = [];
  /** @type {string[]} */
  const received = [];
  const pageSocket = new PageSocket(
    { opened: () => received.push('open'), closed: () => received.push('closed'), text: (text) => received.push(text), bytes: () => received.push('bytes') },
    () => /** @type {any} */ (sockets[sockets.push(new Socket()) - 1]),
    () => now_ms,
    () => chance.now,
  );
  const at = (/** @type {number} */ ms) => { now_ms = ms; };
  /** Looks as the page does, from then to then. @param {number} from_ms @param {number} to_ms */
  const look = (from_ms, to_ms) => {
    for (now_ms = from_ms; now_ms <= to_ms; now_ms += 100) pageSocket.look(now_ms);
  };
  return { pageSocket, sockets, received, at, look, chance };
}

test('a quiet connection is given up though the browser reports nothing, and what it still brings is not delivered', () => {
  const { pageSocket, sockets, received } = set();
  pageSocket.look(0);
  const first = sockets[0];
  first?.onopen();
  const late = first?.onmessage;
  pageSocket.proof(1000);
  pageSocket.look(3500);
  assert.equal(first?.isClosed, false);
  pageSocket.look(3501);
  assert.equal(first?.isClosed, true);
  assert.deepEqual(received, ['open', 'closed']);
  assert.equal(first?.onmessage, null);
  assert.equal(typeof late, 'function');
  assert.equal(sockets.length, 2);
});

test('a connection that has just opened is alive, however long its dial took', () => {
  const { sockets, at, look } = set();
  look(0, 3900);
  at(4000);
  sockets[0]?.onopen();
  look(4100, 8900);
  assert.equal(sockets[0]?.isClosed, false);
  look(9000, 20_000);
  assert.equal(sockets[0]?.isClosed, true);
});

test('a connection of a weak radio gets more time, and what was measured holds for the next one', () => {
  const { pageSocket, sockets, at, look } = set();
  pageSocket.look(0);
  at(1200);
  sockets[0]?.onopen();
  for (const [took_ms, came_ms] of [[2000, 2800], [3000, 4500], [5000, 5700]]) {
    at(Number(took_ms));
    pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'] }), Number(took_ms));
    pageSocket.send({ kind: 'take', seq: 1 });
    pageSocket.answered(Number(came_ms), 'state');
    pageSocket.answered(Number(came_ms) + 500, 'state'); // a frame that nobody requested has no information about the round trip
    pageSocket.proof(Number(came_ms));
  }
  look(5700, 8700);
  assert.equal(sockets[0]?.isClosed, false);
  look(8800, 10_700);
  assert.deepEqual([sockets[0]?.isClosed, sockets.length, sockets[1]?.isClosed], [true, 2, false]); // the dial, too
  look(10_800, 12_000);
  assert.equal(sockets.length, 3);
});

test('a requested message proves the connection, whatever is known of the clocks yet', () => {
  const { pageSocket, sockets, at, look } = set();
  pageSocket.look(0);
  at(40);
  sockets[0]?.onopen();
  at(2400);
  pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'] }), 2400);
  pageSocket.send({ kind: 'take', seq: 1 });
  pageSocket.answered(2450, 'state');
  look(2500, 4900);
  assert.equal(sockets[0]?.isClosed, false);
  look(5000, 5100);
  assert.equal(sockets[0]?.isClosed, true);
});

test('only what was requested measures the round trip: one of the states that a connection begins with does not answer a take of another kind', () => {
  const { pageSocket, at, look, sockets } = set();
  pageSocket.look(0);
  at(20);
  sockets[0]?.onopen();
  const before = pageSocket.trip;
  pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['cars'], took: 0 }), 80);
  at(2400);
  pageSocket.send({ kind: 'take', seq: 1 });
  pageSocket.answered(2402, 'state');
  assert.deepEqual(pageSocket.trip, before);
  pageSocket.answered(2480, 'cars');
  assert.deepEqual(pageSocket.trip, { mean_ms: 10 + (80 - 10) / 8, spread_ms: 5 + (70 - 5) / 4 });
  pageSocket.offered(/** @type {any} */ ({ seq: 2, of: ['cars', 'state'], took: 1 }), 2480);
  at(2500);
  pageSocket.send({ kind: 'take', seq: 2 });
  pageSocket.answered(2580, 'state');
  assert.equal(pageSocket.trip?.mean_ms, 18.75 + (80 - 18.75) / 8);
  look(2600, 5000);
  assert.equal(sockets[0]?.isClosed, false, 'both answers prove the connection');
});

test('over a good radio that was cut a dial comes every two or three seconds, now and then a longer one', () => {
  const { pageSocket, sockets, at, look } = set();
  pageSocket.look(0);
  at(40);
  sockets[0]?.onopen();
  look(100, 2700);
  const dials = [];
  for (let ms = 2700, count = sockets.length; ms < 62_700; ms += 100) {
    pageSocket.look(ms);
    if (sockets.length > count) dials.push(ms);
    count = sockets.length;
  }
  const gaps = dials.slice(1).map((ms, i) => ms - Number(dials[i]));
  assert.deepEqual([...new Set(gaps)].map((ms) => Math.round(ms / 1000)).sort(), [2, 5]);
});

test('no dial is so long that the system seldom repeats its request, however slow the radio was', () => {
  const { sockets, at, look } = set();
  look(0, 3900);
  at(4000);
  sockets[0]?.onopen();
  look(4100, 12_100); // it is given up, and dialled again
  const dialled = [];
  for (let ms = 12_200; ms < 72_200; ms += 100) {
    const count = sockets.length;
    look(ms, ms);
    if (sockets.length > count) dialled.push(ms);
  }
  const gaps = dialled.slice(1).map((ms, i) => ms - Number(dialled[i]));
  assert.ok(gaps.length > 3);
  assert.ok(Math.max(...gaps) <= 8200, String(gaps));
});

test('a page that knew a fast radio connects over one on which a connection takes 4.2 s', () => {
  const { pageSocket, sockets, at, look } = set();
  pageSocket.look(0);
  at(40);
  sockets[0]?.onopen();
  look(100, 2700);
  const began = new Map();
  for (let ms = 2700; ms < 62_700 && !pageSocket.isOpen; ms += 100) {
    at(ms);
    pageSocket.look(ms);
    const newest = sockets.at(-1);
    if (newest && !began.has(newest)) began.set(newest, ms);
    if (newest && ms - began.get(newest) >= 4200) newest.onopen?.();
  }
  assert.ok(pageSocket.isOpen);
});

test('one dial in nine is of 16 s where others are of 8 s: a page connects over a radio on which a connection takes 12 s', () => {
  const { pageSocket, sockets, at } = set();
  /** @type {number[]} */
  const began = [];
  for (let ms = 0; ms < 120_000 && !pageSocket.isOpen; ms += 100) {
    at(ms);
    pageSocket.look(ms);
    if (sockets.length > began.length) began.push(ms);
    if (ms - Number(began.at(-1)) >= 12_000) sockets.at(-1)?.onopen?.();
  }
  assert.ok(pageSocket.isOpen);
  const gaps = began.slice(1).map((ms, i) => Math.floor((ms - Number(began[i])) / 1000));
  assert.deepEqual(gaps, [5, 5, 8, 5, 5, 8, 5, 5]);
});

/** Opens at 0.3 s, as over a radio with a round trip of 0.15 s; a server that sends states ahead. */
function slow() {
  const one = set();
  one.pageSocket.look(0);
  one.at(300);
  one.sockets[0]?.onopen();
  one.pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'], took: 0 }), 400);
  return one;
}

test('over a slow radio another connection is dialled beside a quiet one, and takes its place once the server greets it', () => {
  const { sockets, received, at, look, pageSocket } = slow();
  look(400, 1300);
  assert.equal(sockets.length, 1);
  look(1400, 1500);
  assert.equal(sockets.length, 2);
  assert.deepEqual([sockets[0]?.isClosed, pageSocket.isOpen], [false, true]);
  at(1600);
  pageSocket.send({ kind: 'pause' });
  assert.equal(sockets[0]?.sent.length, 1);
  sockets[1]?.onopen();
  pageSocket.send({ kind: 'pause' });
  assert.deepEqual([sockets[0]?.isClosed, sockets[0]?.sent.length], [false, 2], 'the server may still refuse the other one');
  sockets[1]?.onmessage({ data: 'duty' });
  assert.equal(sockets[0]?.isClosed, false, 'it brings no ticket');
  sockets[1]?.onmessage({ data: HELLO });
  assert.equal(sockets[0]?.isClosed, true);
  pageSocket.send({ kind: 'pause' });
  assert.deepEqual([sockets[0]?.sent.length, sockets[1]?.sent.length], [2, 1], 'over one connection, never over both');
  assert.deepEqual(received, ['open', 'closed', 'open', 'duty', HELLO]);
  assert.equal(sockets[0]?.onmessage, null);
});

test('what the other connection brought before its greeting is read where the first one is given up meanwhile', () => {
  const { sockets, received, look } = slow();
  look(400, 1500);
  sockets[1]?.onopen();
  sockets[1]?.onmessage({ data: 'duty' });
  look(1600, 3000);
  assert.equal(sockets[0]?.isClosed, true);
  sockets[1]?.onmessage({ data: 'unserved' });
  assert.deepEqual(received, ['open', 'closed', 'open', 'duty', 'unserved']);
});

test('a quiet connection that answers before the other one does stays, and one that the server refuses takes no place', () => {
  const { sockets, received, at, look, pageSocket } = slow();
  look(400, 1500);
  sockets[1]?.onopen();
  sockets[1]?.onclose(); // as of a device with too many pages
  assert.deepEqual([sockets[0]?.isClosed, sockets[1]?.isClosed, pageSocket.isOpen], [false, true, true]);
  look(1600, 2500);
  assert.equal(sockets.length, 2, 'the next one waits for a second');
  look(2600, 2700);
  assert.equal(sockets.length, 3);
  at(2800);
  pageSocket.proof(2800);
  assert.equal(sockets[2]?.isClosed, false, 'what it brings may be needed yet');
  sockets[2]?.onopen();
  sockets[2]?.onmessage({ data: HELLO });
  assert.deepEqual([sockets[0]?.isClosed, sockets[2]?.isClosed, sockets[2]?.onmessage], [false, true, null]);
  assert.deepEqual([sockets.length, received], [3, ['open']]);
});

test('connections that are not needed become seldom: after 1, 2, 4, 8 and 10 s', () => {
  const one = slow();
  const { sockets, pageSocket, at } = one;
  /** @type {number[]} */
  const gaps = [];
  let [last_ms, quiet_ms] = [NaN, 0];
  for (let ms = 400; ms < 60_000; ms += 100) {
    const count = sockets.length;
    at(ms);
    pageSocket.look(ms);
    if (ms - quiet_ms >= 1200) pageSocket.proof(quiet_ms = ms); // quiet for 1.2 s again and again
    if (sockets.length === count) continue;
    gaps.push(ms - last_ms);
    last_ms = ms;
    pageSocket.proof(quiet_ms = ms);
    sockets.at(-1)?.onopen();
    sockets.at(-1)?.onmessage({ data: HELLO });
  }
  assert.deepEqual(gaps.slice(1).map((ms) => Math.floor(ms / 1000)), [1, 2, 4, 8, 10, 10, 10], String(gaps));
});

test('connections that take each other\'s place within half a minute wait too, up to 4 s, until there was none for so long', () => {
  const { sockets, pageSocket, at } = slow();
  /** @type {number[]} */
  const gaps = [];
  let [swapped_ms, came_ms] = [NaN, 0];
  for (let ms = 400; ms < 120_000; ms += 100) {
    const count = sockets.length;
    at(ms);
    if (ms - came_ms >= 1900 || ms > 50_000 && ms < 85_000) pageSocket.proof(came_ms = ms); // one long message after another
    pageSocket.look(ms);
    if (sockets.length === count) continue;
    sockets.at(-1)?.onopen();
    sockets.at(-1)?.onmessage({ data: HELLO });
    assert.equal(sockets.at(-2)?.isClosed, true);
    gaps.push(Math.round((ms - swapped_ms) / 1000));
    [swapped_ms, came_ms] = [ms, ms];
  }
  assert.deepEqual(gaps.slice(1), [1, 1, 3, 5, 5, 5, 5, 5, 5, 5, 5, 40, 1, 1, 3, 5, 5, 5, 5, 5]);
});

test('nothing is sent on a connection that was quiet for too long, though the other one is not open yet', () => {
  const { sockets, received, look, pageSocket } = slow();
  look(400, 2800);
  assert.equal(pageSocket.isOpen, true);
  look(2900, 3000);
  assert.deepEqual([pageSocket.isOpen, pageSocket.send({ kind: 'pause' }), sockets[0]?.isClosed], [false, false, true]);
  assert.equal(sockets[1]?.isClosed, false, 'its dial is not over');
  sockets[1]?.onopen();
  assert.deepEqual(received, ['open', 'closed', 'open']);
});

test('a connection over which anything comes is not doubled: the server has nothing fresh', () => {
  const { sockets, at, look } = slow();
  look(400, 1200);
  at(1250);
  sockets[0]?.onmessage({ data: '{"kind":"offer"}' });
  look(1300, 2200);
  assert.equal(sockets.length, 1);
  look(2300, 2400);
  assert.equal(sockets.length, 2);
});

test('pages that one server kept waiting do not all dial at once, nor one that stood still itself', () => {
  const dialled = [0, 0.5, 1].map((now) => {
    const { sockets, pageSocket, at, chance } = set();
    chance.now = now;
    pageSocket.look(0);
    at(300);
    sockets[0]?.onopen();
    pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'], took: 0 }), 400);
    for (let ms = 400; ms < 2500; ms += 50) {
      at(ms);
      pageSocket.look(ms);
      if (sockets.length === 2) return ms;
    }
    return NaN;
  });
  assert.deepEqual(dialled, [1350, 1600, 1850]);
  const { sockets, look } = slow();
  look(400, 500);
  look(1900, 1900); // what came meanwhile is not read yet
  assert.equal(sockets.length, 1);
  look(2000, 2000);
  assert.equal(sockets.length, 2);
});

test('over a good radio no connection is dialled beside a quiet one', () => {
  const { sockets, at, look, pageSocket } = set();
  pageSocket.look(0);
  at(20);
  sockets[0]?.onopen();
  pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'], took: 0 }), 30);
  look(100, 2500);
  assert.equal(sockets.length, 1);
});

test('an offer answers the take that it names, and one of nothing measures the round trip', () => {
  const { sockets, at, pageSocket } = slow();
  const before = pageSocket.trip;
  for (const ms of [1000, 1100, 1200]) {
    at(ms);
    pageSocket.answered(ms, 'state');
  }
  const takes = sockets[0]?.sent.map((text) => JSON.parse(text));
  assert.deepEqual(takes?.map(({ n, ahead, got }) => [n, ahead, got]), [[1, 3, 1], [2, 3, 2], [3, 3, 3]]);
  assert.equal(pageSocket.offered(/** @type {any} */ ({ seq: 2, of: ['cars'], took: 2 }), 1400), 1100);
  assert.equal(pageSocket.trip, before);
  assert.equal(pageSocket.offered(/** @type {any} */ ({ seq: 3, of: [], took: 3 }), 1400), 1200);
  assert.notEqual(pageSocket.trip, before);
  assert.equal(pageSocket.offered(/** @type {any} */ ({ seq: 4, of: ['state'], took: 77 }), 1400), -Infinity, 'of no take of this page');
  assert.equal(pageSocket.offered(/** @type {any} */ ({ seq: 5, of: ['state'] }), 1400), 1200, 'of a former server: the last one');
});

test('the first state of the next connection is answered at once: the server may then send ahead; a former one is not', () => {
  const { sockets, at, pageSocket, look } = slow();
  const [, second, third] = [1000, 4000, 7000].map((ms) => {
    sockets.at(-1)?.onclose?.();
    at(ms);
    pageSocket.look(ms);
    sockets.at(-1)?.onopen();
    pageSocket.answered(ms, 'state');
    if (ms === 4000) pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'] }), ms);
    return sockets.at(-1)?.sent.map((text) => JSON.parse(text));
  });
  assert.deepEqual(second, [{ kind: 'take', seq: 0, n: 1, ahead: 3, got: 1 }]);
  assert.deepEqual(third, []);
  pageSocket.slept();
  assert.equal(pageSocket.isTrusted, true);
  look(7100, 7100);
});

test('a state that came ahead proves nothing, nor does an answer that took longer than a connection may be quiet', () => {
  for (const [lag_ms, isClosed] of /** @type {[number, boolean][]} */ ([[500, false], [20_000, true]])) {
    const { sockets, at, pageSocket, look } = slow();
    for (let ms = 500; ms < 40_000; ms += 500) {
      at(ms);
      pageSocket.answered(ms, 'state'); // an old one: nothing calls `proof`
      pageSocket.offered(/** @type {any} */ ({ seq: 2, of: [], took: (ms - lag_ms) / 500 }), ms);
      look(ms, ms);
    }
    assert.equal(sockets[0]?.isClosed, isClosed);
  }
});

test('a take that waits for its turn is not sent over another connection, and keeps none of that waiting', (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const { sockets, at, pageSocket } = slow();
  const takes = (/** @type {number} */ i) => sockets[i]?.sent.map((text) => JSON.parse(text)).filter(({ kind }) => kind === 'take').map(({ seq }) => seq);
  at(1000);
  for (const seq of [7, 8]) pageSocket.takeInTurn(() => pageSocket.send({ kind: 'take', seq }));
  pageSocket.takeInTurn(() => pageSocket.send({ kind: 'take', seq: 9 }));
  assert.deepEqual(takes(0), [7, 8], 'the third waits');
  sockets[0]?.onclose();
  at(3500);
  pageSocket.look(3500);
  sockets[1]?.onopen();
  pageSocket.send({ kind: 'watch' });
  pageSocket.send({ kind: 'watch' });
  pageSocket.takeInTurn(() => pageSocket.send({ kind: 'take', seq: 1 }));
  at(3600);
  t.mock.timers.tick(200);
  assert.deepEqual([takes(0), takes(1)], [[7, 8], [1]]);
});

test('after a sleep states are trusted once the take is answered that is sent at once', () => {
  const { sockets, at, pageSocket } = slow();
  at(1000);
  pageSocket.answered(1000, 'state');
  pageSocket.slept();
  assert.equal(pageSocket.isTrusted, false);
  const { n, seq, ahead } = JSON.parse(String(sockets[0]?.sent.at(-1)));
  assert.deepEqual([n, seq, ahead], [2, 0, 3]);
  pageSocket.offered(/** @type {any} */ ({ seq: 2, of: [], took: 1 }), 1100);
  assert.equal(pageSocket.isTrusted, false, 'of before the sleep');
  pageSocket.offered(/** @type {any} */ ({ seq: 3, of: [], took: 2 }), 1200);
  assert.equal(pageSocket.isTrusted, true);
});

test('after a sleep no state is trusted before that either where none comes ahead now, but of a former server each', () => {
  for (const [took, isTrusted] of /** @type {[number | undefined, boolean][]} */ ([[0, false], [undefined, true]])) {
    const { sockets, at, pageSocket } = set();
    pageSocket.look(0);
    at(20);
    sockets[0]?.onopen();
    pageSocket.offered(/** @type {any} */ ({ seq: 1, of: ['state'], ...(took === undefined ? {} : { took }) }), 30);
    pageSocket.slept();
    assert.deepEqual([pageSocket.isTrusted, sockets[0]?.sent.length], [isTrusted, isTrusted ? 0 : 1]);
    pageSocket.offered(/** @type {any} */ ({ seq: 2, of: ['state'], ...(took === undefined ? {} : { took: 1 }) }), 60);
    assert.equal(pageSocket.isTrusted, true);
  }
});

test('a server that refuses at once is dialled every two seconds', () => {
  const { pageSocket, sockets } = set();
  for (let ms = 0; ms < 60_000; ms += 100) {
    pageSocket.look(ms);
    sockets.at(-1)?.onclose?.();
  }
  assert.ok(sockets.length >= 60 / 2.2 && sockets.length <= 60 / 2 + 5, String(sockets.length));
});

test('it dials for ever', () => {
  const { pageSocket, sockets, look } = set();
  look(0, 120_000);
  assert.ok(sockets.length >= 120 / 7.2 && sockets.length <= 120 / 5, String(sockets.length));
  pageSocket.hurry();
  const before = sockets.length;
  look(120_000, 130_300);
  assert.ok(sockets.length > before);
});

test('nothing is sent while it is not open, and nothing is kept', () => {
  const { pageSocket, sockets } = set();
  assert.equal(pageSocket.send({ kind: 'pause' }), false);
  pageSocket.look(0);
  assert.equal(pageSocket.send({ kind: 'pause' }), false);
  sockets[0]?.onopen();
  assert.deepEqual(sockets[0]?.sent, []);
  assert.equal(pageSocket.send({ kind: 'take', seq: 1 }), true);
  assert.deepEqual(sockets[0]?.sent, ['{"kind":"take","seq":1,"n":1}']);
});

test('messages that are none of ours are refused', () => {
  for (const text of ['', '{', '[]', 'null', '7', '{"kind":"constructor"}', '{"kind":"state"}', '{"kind":"offer","seq":"1"}', '{"kind":"events","events":{}}', '{"kind":"state","server":null}']) {
    assert.equal(readMessage(text), null, text);
  }
  assert.deepEqual(readMessage('{"kind":"offer","seq":4,"of":["state"]}'), { kind: 'offer', seq: 4, of: ['state'] });
});
