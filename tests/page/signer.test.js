import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Signer } from '../../static/js/core/signer.js';

const CONTEXT = { vehicle: 'ocelot', challenge: 'c', by: 'Ännchen', page: '0123abcd' };

test('an order is signed by a key that cannot be taken out, and the signature is of the very text', async () => {
  const signer = new Signer(); // where nothing can be kept, by a key of this page
  const { id, kind, vehicle, signed } = /** @type {any} */ (await signer.sealed({ kind: 'pause', id: 'p1', fence: 3 }, CONTEXT));
  assert.deepEqual([id, kind, vehicle], ['p1', 'pause', 'ocelot']);
  const { command, nonce, ...rest } = JSON.parse(signed.text);
  assert.deepEqual([command, rest], [{ kind: 'pause', fence: 3 }, CONTEXT]);
  assert.ok(nonce.length >= 16);
  const key = await crypto.subtle.importKey('raw', Buffer.from(signed.key, 'base64'), { name: 'ECDSA', namedCurve: 'P-256' }, true, ['verify']);
  const verify = (/** @type {string} */ text) => crypto.subtle.verify({ name: 'ECDSA', hash: 'SHA-256' }, key, Buffer.from(signed.signature, 'base64'), new TextEncoder().encode(text));
  assert.equal(await verify(`catgraph order 1\n${signed.text}`), true);
  assert.equal(await verify(signed.text), false);
  assert.match(signer.id, /^k[0-9a-f]{32}$/);
});

test('a mark is sent beside its signature too: one that cannot be proved is kept', async () => {
  const sent = /** @type {any} */ (await new Signer().sealed({ kind: 'mark', id: 'p1', vehicle: 'margay', mark: 'm1' }, CONTEXT));
  const { signed, ...plain } = sent;
  assert.deepEqual(plain, { kind: 'mark', id: 'p1', vehicle: 'margay', mark: 'm1' });
  assert.deepEqual(JSON.parse(signed.text).command, { kind: 'mark', vehicle: 'margay', mark: 'm1' });
});

test('what is of the page alone is not signed, and a page without TLS signs nothing', async (t) => {
  const signer = new Signer();
  assert.equal(signer.sealed({ kind: 'replay', id: 'p1' }, CONTEXT), null);
  t.mock.getter(globalThis, 'crypto', () => ({}));
  const plain = new Signer();
  assert.deepEqual(await plain.sealed({ kind: 'pause', id: 'p1', fence: 3 }, CONTEXT), { kind: 'pause', id: 'p1', fence: 3 });
  assert.equal(plain.isSettled, true);
  assert.equal(plain.sealed({ kind: 'pause', id: 'p1' }, CONTEXT), null);
  assert.deepEqual(await plain.header({ kind: 'import' }, CONTEXT, { toml: '' }), {});
});

test('a storage that never answers holds no order back for longer than 2 s', async (t) => {
  t.mock.timers.enable({ apis: ['setTimeout'] });
  const global = /** @type {any} */ (globalThis);
  global.indexedDB = { open: () => ({}) };
  t.after(() => { delete global.indexedDB; });
  const signer = new Signer();
  const sealed = signer.sealed({ kind: 'pause', id: 'p1', fence: 3 }, CONTEXT);
  t.mock.timers.tick(1999);
  await new Promise((resolve) => { setImmediate(resolve); });
  assert.equal(signer.isSettled, false);
  t.mock.timers.tick(1);
  assert.ok(/** @type {any} */ (await sealed).signed);
});

test('it takes no time that an operator would notice', async () => {
  const signer = new Signer();
  await signer.sign({ kind: 'pause' }, CONTEXT);
  const before = process.cpuUsage();
  for (let i = 0; i < 50; i += 1) await signer.sign({ kind: 'slow_down' }, CONTEXT);
  const { user, system } = process.cpuUsage(before);
  const each_ms = (user + system) / 1000 / 50; // of the processor: what else runs on the machine does not count
  assert.ok(each_ms < 5, `${each_ms} ms`);
});
