import assert from 'node:assert/strict';
import { test } from 'node:test';
import { alone } from '../../static/js/drive/mark-locks.js';
import { MarkKeep } from '../../static/js/drive/mark-keep.js';
import { bereft, headWords, joined, moreWords, newMark, orphaned } from '../../static/js/drive/mark-model.js';
import { Marks } from '../../static/js/drive/marks.js';

/** @typedef {import('../../static/js/drive/mark-model.js').Mark} Mark */

const AT_MS = Date.UTC(2026, 10, 19, 14, 7, 32, 250);

/** @param {string} id @param {Partial<Mark>} [more] @returns {Mark} */
const mark = (id, more = {}) => ({ ...newMark(id, 'car', { at_ms: AT_MS, ahead_ms: 0, source: 'measured' }, AT_MS), ...more });
const part = (more = {}) => ({ blob: /** @type {Blob | null} */ (new Blob(['abc'])), type: 'audio/webm', bytes: 3, length_s: 6.2, note: '', isOpen: false, isStored: false, ...more });
const same = (/** @type {Mark} */ now) => now;

/** @returns {Storage} */
function storage(mostBytes = Infinity) {
  const kept = new Map();
  return /** @type {any} */ ({
    getItem: (/** @type {string} */ key) => kept.get(key) ?? null,
    setItem: (/** @type {string} */ key, /** @type {string} */ value) => {
      if (value.length > mostBytes) throw new DOMException('full', 'QuotaExceededError');
      kept.set(key, value);
    },
    removeItem: (/** @type {string} */ key) => kept.delete(key),
  });
}

/** A database that several pages open; each transaction is over before the next begins. @param {{isFull?: boolean}} [state] */
function database(state = {}) {
  /** @type {Map<string, Mark>} */
  const kept = new Map();
  const request = (/** @type {any} */ result) => {
    const request = /** @type {any} */ ({ result: structuredClone(result) });
    queueMicrotask(() => request.onsuccess?.());
    return request;
  };
  const transaction = () => {
    const at = /** @type {any} */ ({ error: null });
    let isFull = false;
    at.objectStore = () => ({
      get: (/** @type {string} */ id) => request(kept.get(id)),
      getAll: () => request([...kept.values()]),
      put: (/** @type {Mark} */ one) => {
        if (state.isFull && (one.voice?.blob || one.photo?.blob)) isFull = true;
        else kept.set(one.id, structuredClone(one));
      },
      delete: (/** @type {string} */ id) => kept.delete(id),
    });
    setImmediate(() => (isFull ? at.onabort?.() : at.oncomplete?.()));
    return at;
  };
  return { kept, open: async () => /** @type {IDBDatabase} */ (/** @type {any} */ ({ transaction })) };
}

const none = () => Promise.reject(new Error('refused'));

test('without a database marks are listed without their voice, and a full storage is shown', async () => {
  const kept = storage();
  const keep = new MarkKeep(kept, none);
  assert.equal((await keep.change('a', same, mark('a'))).kept, 'whole');
  assert.equal((await keep.change('b', same, mark('b', { voice: part() }))).kept, 'without parts');
  const again = await new MarkKeep(kept, none).all();
  assert.deepEqual(again.map(({ id, voice }) => [id, voice?.blob ?? null]), [['a', null], ['b', null]]);
  await keep.change('a', () => null, mark('a'));
  assert.deepEqual((await keep.all()).map(({ id }) => id), ['b']);
  assert.equal((await new MarkKeep(storage(10), none).change('c', same, mark('c'))).kept, 'memory');
  assert.equal((await new MarkKeep(null, none).change('c', same, mark('c'))).kept, 'memory');
});

test('two pages that change one mark lose nothing of each other', async () => {
  const shared = database();
  const [one, other] = [new MarkKeep(null, shared.open), new MarkKeep(null, shared.open)];
  await one.change('a', same, mark('a'));
  const seen = /** @type {Mark} */ (await other.get('a'));
  await one.change('a', (now) => ({ ...now, words: 'late', version: now.version + 1, stored: 1 }), mark('a'));
  const { mark: both } = await other.change('a', (now) => ({ ...now, category: 'control', version: now.version + 1 }), seen);
  assert.deepEqual([both?.words, both?.category, both?.version, both?.stored], ['late', 'control', 3, 1]);
});

test('of two copies the newer counts, and a voice that only the page has is not lost to a full storage', async () => {
  const shared = database({ isFull: true });
  const keep = new MarkKeep(null, shared.open);
  const own = mark('a', { voice: part({ made: '1' }) });
  const first = await keep.change('a', same, own);
  assert.equal(first.kept, 'without parts');
  assert.equal(shared.kept.get('a')?.voice?.blob, null);
  const { mark: now } = await keep.change('a', (was) => ({ ...was, words: 'late' }), /** @type {Mark} */ (first.mark));
  assert.ok(now?.voice?.blob, 'this page still has it');
  assert.equal(joined(mark('a', { turn: 2, words: 'old' }), mark('a', { turn: 3, words: 'new' })).words, 'new');
  assert.equal(joined(mark('a', { turn: 3, photo: part({ blob: null, made: '2' }) }), mark('a', { photo: part({ made: '1' }) })).photo?.blob, null, 'it was replaced');
});

test('what was lost with a full storage is reported, and a voice that was being spoken is cut', () => {
  const lost = bereft(mark('a', { stored: 1, voice: part({ blob: null }), photo: part({ blob: null }) }));
  assert.deepEqual(moreWords(lost), ['voice lost: the storage was full', 'photo lost: the storage was full']);
  assert.match(headWords(lost), / voice lost$/);
  assert.match(headWords(orphaned(mark('a', { voice: part({ isOpen: true }) }))), / voice cut$/);
  assert.deepEqual(moreWords(bereft(orphaned(mark('a', { voice: part({ isOpen: true, blob: null }) })))), ['voice lost: the storage was full']);
  assert.deepEqual(moreWords(joined(mark('a', { voice: part({ blob: null }) }), lost)), ['voice lost: the storage was full'], 'it stays shown');
  const found = joined(lost, mark('a', { voice: part(), photo: part({ note: 'photo 2 MB' }) }));
  assert.match(headWords(found), / voice$/);
  assert.deepEqual(moreWords(found), ['6.2 s', 'photo 2 MB'], 'a page still has it; the head says voice');
  const stored = mark('a', { stored: 1, voice: part({ blob: null, isStored: true }) });
  assert.deepEqual(bereft(stored), stored);
});

/** The locks of a browser. */
function locks() {
  /** @type {Map<string, Promise<unknown>>} */
  const held = new Map();
  return {
    request: (/** @type {string} */ name, /** @type {() => Promise<unknown>} */ act) => {
      const mine = (held.get(name) ?? Promise.resolve()).then(act);
      held.set(name, mine);
      return mine.finally(() => held.get(name) === mine && held.delete(name));
    },
    query: async () => ({ held: [...held.keys()].map((name) => ({ name })) }),
  };
}

/** A page of a car, with a server that takes everything once it is there. @param {() => Promise<IDBDatabase>} open @param {string[]} received */
function page(open, received) {
  const state = { now_ms: 0, isThere: false };
  /** @type {Map<string, () => void>} */
  const listeners = new Map();
  const store = {
    vehicle: 'car', isSilent: false, unserved: null, now: () => state.now_ms, on: (/** @type {string} */ what, /** @type {() => void} */ listener) => {
      listeners.set(what, listener);
      return () => {};
    },
    get frame() { return state.isThere ? {} : null; },
    socket: { isOpen: true },
    ask: async (/** @type {string} */ kind, /** @type {{mark: string, words: string}} */ { mark: id, words }) => {
      received.push(`${kind} ${id} ${words}`);
      return { ok: true };
    },
  };
  const marks = new Marks(/** @type {any} */ (store), () => {}, new MarkKeep(null, open));
  return { marks, state, tick: () => listeners.get('tick')?.() };
}

for (const [name, given, together] of /** @type {const} */ ([
  ['locks', () => locks(), 1],
  ['no locks', () => undefined, 2],
  ['refused locks', () => ({ request: () => Promise.reject(new DOMException('', 'SecurityError')) }), 2],
])) {
  test(`with ${name} ${together} of two pages act at a time, and both do in the end`, async () => {
    Object.defineProperty(globalThis, 'navigator', { value: { locks: given() }, configurable: true });
    let [now, most, done] = [0, 0, 0];
    const act = async () => {
      now += 1;
      most = Math.max(most, now);
      await new Promise(setImmediate);
      now -= 1;
      done += 1;
    };
    await Promise.all([alone('commands', act), alone('commands', act)]);
    assert.deepEqual([most, done], [together, 2]);
  });
}

const settled = async () => { for (let i = 0; i < 60; i += 1) await new Promise(setImmediate); };

test('two pages deliver a mark once, as it was changed last, and nothing of a page that was closed is lost', async () => {
  Object.defineProperty(globalThis, 'navigator', { value: { locks: locks() }, configurable: true });
  const shared = database();
  /** @type {string[]} */
  const received = [];
  const one = page(shared.open, received);
  const { id } = one.marks.place();
  const taken = one.marks.place().id;
  await settled();
  const other = page(shared.open, received);
  await other.marks.ready;
  assert.equal(other.marks.waiting.length, 2);
  await one.marks.edit(id, { words: 'late' });
  await one.marks.remove(taken);
  one.state.isThere = other.state.isThere = true;
  await Promise.all([other.marks.delivery.hurry(), one.marks.delivery.hurry()]);
  await settled();
  assert.deepEqual(received, [`mark ${id} late`]);
  assert.deepEqual(other.marks.all.map((now) => [now.id, now.words, now.stored]), [[id, 'late', 2]]);
  one.state.isThere = false;
  const last = one.marks.place().id;
  await settled();
  one.marks.stop();
  other.state.now_ms += 31_000;
  other.tick();
  await settled();
  assert.equal(received.at(-1)?.startsWith(`mark ${last}`), true);
});

test('a voice that is spoken in one page is not ended by another, before its page is closed', async () => {
  const held = locks();
  Object.defineProperty(globalThis, 'navigator', { value: { locks: held }, configurable: true });
  const shared = database();
  const one = page(shared.open, []);
  const { id } = one.marks.place();
  await one.marks.attach(id, 'voice', part({ isOpen: true }));
  const other = page(shared.open, []);
  await other.marks.ready;
  await settled();
  assert.equal(other.marks.get(id)?.voice?.isOpen, true);
  await one.marks.attach(id, 'voice', part());
  await settled();
  assert.deepEqual((await held.query()).held, [], 'it was let go');
  shared.kept.set('left', mark('left', { wall_ms: Date.now(), voice: part({ isOpen: true }) }));
  other.state.now_ms += 31_000;
  other.tick();
  await settled();
  assert.equal(shared.kept.get('left')?.voice?.note, 'voice cut: the page was closed');
});
