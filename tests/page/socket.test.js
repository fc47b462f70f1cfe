import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readMessage } from '../../static/js/core/protocol.js';
import { PageSocket } from '../../static/js/core/socket.js';

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
  /** @type {Socket[]} */
  const sockets = [];
  /** @type {string[]} */
  const heard = [];
  const pageSocket = new PageSocket(
    { opened: () => heard.push('open'), closed: () => heard.push('closed'), text: (text) => heard.push(text), bytes: () => heard.push('bytes') },
    () => /** @type {any} */ (sockets[sockets.push(new Socket()) - 1]),
  );
  return { pageSocket, sockets, heard };
}

test('a quiet connection is given up though the browser reports nothing, and what it still brings is not heard', () => {
  const { pageSocket, sockets, heard } = set();
  pageSocket.look(0);
  const first = sockets[0];
  first?.onopen();
  const late = first?.onmessage;
  pageSocket.proof(1000);
  pageSocket.look(3500);
  assert.equal(first?.isClosed, false);
  pageSocket.look(3501);
  assert.equal(first?.isClosed, true);
  assert.deepEqual(heard, ['open', 'closed']);
  assert.equal(first?.onmessage, null);
  assert.equal(typeof late, 'function');
  pageSocket.look(3600);
  assert.equal(sockets.length, 1); // not at once
  pageSocket.look(3801);
  assert.equal(sockets.length, 2);
});

test('it dials for ever, each time a little later, at most every two seconds beside the time of a dial', () => {
  const { pageSocket, sockets } = set();
  for (let at = 0; at < 120_000; at += 100) pageSocket.look(at);
  assert.ok(sockets.length >= 120 / 7.2 && sockets.length <= 120 / 5, String(sockets.length));
  pageSocket.hurry();
  const before = sockets.length;
  for (let at = 120_000; at < 125_300; at += 100) pageSocket.look(at);
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
  assert.deepEqual(sockets[0]?.sent, ['{"kind":"take","seq":1}']);
});

test('messages that are none of ours are refused', () => {
  for (const text of ['', '{', '[]', 'null', '7', '{"kind":"constructor"}', '{"kind":"state"}', '{"kind":"offer","seq":"1"}', '{"kind":"events","events":{}}', '{"kind":"state","server":null}']) {
    assert.equal(readMessage(text), null, text);
  }
  assert.deepEqual(readMessage('{"kind":"offer","seq":4,"of":["state"]}'), { kind: 'offer', seq: 4, of: ['state'] });
});
