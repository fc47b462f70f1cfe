import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { test } from 'node:test';
import vm from 'node:vm';
import { takeEarly } from '../../static/js/boot/early-socket.js';
import { PageSocket } from '../../static/js/core/socket.js';

/** @typedef {import('../../static/js/boot/early-socket.js').Early} Early */

class Socket {
  /** @type {string[]} */
  sent = [];
  isClosed = false;

  /** @param {string} text */
  send(text) {
    this.sent.push(text);
  }

  close() {
    this.isClosed = true;
  }
}

/** What early.js leaves behind. @param {Early['queue']} queue */
function dialled(queue) {
  const socket = new Socket();
  const early = /** @type {Early} */ ({ queue, handle: null, socket: /** @type {any} */ (socket) });
  /** @type {any} */ (globalThis).catgraphEarly = early;
  return { early, socket };
}

/** A socket that takes it over, and dials by itself after that. */
function wired() {
  /** @type {unknown[]} */
  const received = [];
  const dials = { count: 0 };
  const pageSocket = new PageSocket(
    {
      opened: () => received.push('open'), closed: () => received.push('closed'),
      text: (text, at_ms) => received.push([text, at_ms]), bytes: (bytes) => received.push(bytes.byteLength),
    },
    () => {
      dials.count += 1;
      return takeEarly() ?? /** @type {any} */ (new Socket());
    },
  );
  return { pageSocket, received, dials };
}

test('what came before the script is delivered first, in its order and with the moment when it came', async () => {
  const { early, socket } = dialled([
    { type: 'open', at_ms: 10 }, { type: 'message', data: 'hello', at_ms: 20 }, { type: 'message', data: new ArrayBuffer(3), at_ms: 30 },
  ]);
  const { pageSocket, received } = wired();
  pageSocket.look(100);
  assert.deepEqual(received, []); // nothing is delivered before there is a listener
  await Promise.resolve();
  early.handle?.({ type: 'message', data: 'later', at_ms: 110 });
  assert.deepEqual(received, ['open', ['hello', 20], 3, ['later', 110]]);
  assert.equal(pageSocket.send({ kind: 'hello' }), true);
  assert.deepEqual(socket.sent, ['{"kind":"hello"}']);
});

test('one that opens after it was taken over is as any other', async () => {
  const { early } = dialled([]);
  const { pageSocket, received } = wired();
  pageSocket.look(0);
  await Promise.resolve();
  assert.equal(pageSocket.send({}), false);
  early.handle?.({ type: 'open', at_ms: 5 });
  early.handle?.({ type: 'message', data: 'hello', at_ms: 6 });
  early.handle?.({ type: 'close', at_ms: 7 });
  assert.deepEqual(received, ['open', ['hello', 6], 'closed']);
});

test('one that failed is not taken over, and none is taken twice', () => {
  dialled([{ type: 'close', at_ms: 5 }]);
  assert.equal(takeEarly(), null);
  dialled([]);
  assert.notEqual(takeEarly(), null);
  assert.equal(takeEarly(), null);
});

test('a ticket is waited for as long as the page waits for the socket, and one that comes after that opens none', async (t) => {
  const source = await readFile(new URL('../../static/js/boot/early.js', import.meta.url), 'utf8');
  t.mock.timers.enable({ apis: ['setTimeout'] });
  for (const [after_ms, isOpen] of /** @type {[number, boolean][]} */ ([[4900, true], [5200, false]])) {
    const opened = [];
    class Dialled extends Socket {
      constructor() {
        super();
        opened.push(this);
      }
    }
    const fetched = (/** @type {string} */ _way, /** @type {RequestInit} */ { signal }) => new Promise((resolve, reject) => {
      signal?.addEventListener('abort', () => reject(signal.reason));
      setTimeout(() => resolve({ json: async () => ({ ticket: 'one' }) }), after_ms);
    });
    const scope = {
      document: { documentElement: { dataset: { access: 'paired', vehicle: 'car' } } }, localStorage: { getItem: () => null },
      location: { search: '', href: 'https://catgraph.local/', protocol: 'https:' }, URL, URLSearchParams, performance,
      AbortSignal: { timeout: (/** @type {number} */ ms) => { const stop = new AbortController(); setTimeout(() => stop.abort(new Error('late')), ms); return stop.signal; } },
      fetch: fetched, WebSocket: Dialled, Error, Promise,
    };
    vm.runInNewContext(source, scope);
    /** @type {any} */ (globalThis).catgraphEarly = /** @type {any} */ (scope).catgraphEarly;
    const { pageSocket, dials } = wired();
    for (let ms = 0; ms <= 5500 && !pageSocket.isOpen; ms += 100) {
      pageSocket.look(ms);
      t.mock.timers.tick(100);
      for (let turn = 0; turn < 10; turn += 1) await Promise.resolve();
      /** @type {any} */ (opened[0])?.onopen();
    }
    assert.equal(pageSocket.isOpen, isOpen, `a ticket after ${after_ms} ms`);
    assert.equal(opened.length, isOpen ? 1 : 0);
    assert.equal(dials.count, isOpen ? 1 : 2);
  }
});
