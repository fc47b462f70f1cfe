// Signs what this device orders, by a key that cannot leave this browser: an agent does not trust a web node's statement of who sent it. server/protocol/signed_order.py.

const ALGORITHM = { name: 'ECDSA', namedCurve: 'P-256' };
const SIGNING = { name: 'ECDSA', hash: 'SHA-256' };
const PREFIX = 'catgraph order 1\n';
const DATABASE = 'catgraph';
const KEYS = 'keys';
const OWN = 'orders';
/** A browser that has not found its key by then signs by a new one: no order may wait for its storage [ms]. */
const KEPT_WITHIN_MS = 2000;

/** Commands of this page alone, queries, and what agents accept without a signature. */
const NO_ORDERS = new Set(['replay', 'outcome', 'position', 'present']);
/** Marks are sent beside their signature too: an agent keeps one whose signature it does not accept, as one that is not signed. */
const KEPT = /mark$/;

/**
 * @typedef {object} Context what is signed beside a command
 * @property {string} vehicle
 * @property {string} challenge of the newest state of the car's agent
 * @property {string} by how this device is called
 * @property {string} page
 * @property {{name: string, role: string} | null} person who is on duty at this device
 * @property {Record<string, string>} [hashes] of arguments that are sent beside it because they are long
 *
 * @typedef {{text: string, key: string, signature: string}} Signed
 */

/** What a page signs, once its server states that it passes orders on to agents, and by which key. */
export class Seal {
  #signs = false;
  /** @type {Signer | null} */
  #signer = null;
  #self;

  /** @param {() => {who: import('./protocol-types.js').Hello['who'] | null, name: string, page: string, duty: import('./protocol-types.js').Duty | null}} self who this page is */
  constructor(self) {
    this.#self = self;
  }

  /** @param {import('./protocol-types.js').Hello} hello */
  greeted({ signs }) {
    this.#signs = signs === true;
    if (this.#signs) this.#signer ??= new Signer();
  }

  /** What a status of the page names; null: not before the key is there, for it would be counted as another page than the one that signs. */
  get named() {
    if (!this.#signs || !this.#signer) return {};
    return this.#signer.isSettled ? this.#signer.named : null;
  }

  /** The id of the key by which agents know this device; '' where it cannot sign; null: no signature is required. */
  get key() {
    return this.#signs ? (this.#signer?.id ?? '') : null;
  }

  /**
   * The message with its command signed; null: it is sent as it is.
   * @param {{kind: string, id: string}} message @param {string} vehicle @param {string | undefined} challenge of the car's agent
   */
  sealed(message, vehicle, challenge) {
    if (!this.#signs) return null;
    if (!challenge) {
      if (!NO_ORDERS.has(message.kind)) console.error('Sent unsigned, without a state:', message.kind);
      return null;
    }
    return this.#signer?.sealed(message, this.#context(vehicle, challenge)) ?? null;
  }

  /**
   * The headers of an order over HTTP.
   * @param {Record<string, unknown>} command @param {Record<string, string>} long arguments of which only the hash is signed
   * @param {string} vehicle @param {string | undefined} challenge
   */
  async headers(command, long, vehicle, challenge) {
    return this.#signs && challenge && this.#signer ? this.#signer.header(command, this.#context(vehicle, challenge), long) : {};
  }

  /** @param {string} vehicle @param {string} challenge @returns {Context} */
  #context(vehicle, challenge) {
    const { who, name, page, duty } = this.#self();
    const person = duty?.me ? { name: duty.me.name, role: duty.me.role } : null;
    return { vehicle, challenge, by: who && who.id !== 'local' ? who.name : name, page, person };
  }
}

export class Signer {
  /** @type {CryptoKeyPair | null} */
  #pair = null;
  #point = '';
  /** The one before is signed first: orders go out in their order. @type {Promise<unknown>} */
  #last = Promise.resolve();
  /** By which an agent knows this device; '' where it cannot sign, or not yet. */
  id = '';
  /** The key is there, or there can be none. */
  isSettled = false;
  /** @type {Promise<void>} */
  #ready;

  get named() {
    return this.id ? { key: this.id } : {};
  }

  constructor() {
    this.#ready = this.#load().catch((error) => console.error('This device cannot sign its orders:', error)).then(() => { this.isSettled = true; });
  }

  /**
   * The message with its command signed; as it is where this device cannot sign. null: messages of this kind are not signed.
   * @param {{kind: string, id: string} & Record<string, unknown>} message
   * @param {Context} context
   * @returns {Promise<object> | null}
   */
  sealed(message, context) {
    if (NO_ORDERS.has(message.kind) || (this.isSettled && !this.id)) return null;
    const made = this.#last.then(() => this.#sealed(message, context));
    this.#last = made.catch(() => {});
    return made;
  }

  /** @param {{kind: string, id: string} & Record<string, unknown>} message @param {Context} context */
  async #sealed({ id, ...command }, context) {
    await this.#ready;
    const { kind } = command;
    const isKept = KEPT.test(kind);
    const signed = this.id ? await this.sign(command, context).catch((error) => { if (!isKept) throw error; }) : undefined;
    return signed ? { kind, id, vehicle: context.vehicle, ...(isKept && command), signed } : { id, ...command };
  }

  /** @param {Record<string, unknown>} command with its kind @param {Context} context @returns {Promise<Signed>} */
  async sign(command, context) {
    await this.#ready;
    if (!this.#pair) throw new Error('This device cannot sign');
    const nonce = base64(crypto.getRandomValues(new Uint8Array(16)));
    const text = JSON.stringify({ command, ...context, nonce });
    const signature = await crypto.subtle.sign(SIGNING, this.#pair.privateKey, new TextEncoder().encode(PREFIX + text));
    return { text, key: this.#point, signature: base64(new Uint8Array(signature)) };
  }

  /**
   * The header of a request over HTTP that orders something; `long`: arguments of which only the hash is signed.
   * @param {Record<string, unknown>} command @param {Context} context @param {Record<string, string>} long
   * @returns {Promise<Record<string, string>>}
   */
  async header(command, context, long) {
    await this.#ready;
    if (!this.id) return {};
    /** @type {Record<string, string>} */
    const hashes = {};
    for (const [name, value] of Object.entries(long)) hashes[name] = await sha256(new TextEncoder().encode(value));
    const signed = await this.sign(command, { ...context, hashes });
    return { 'X-Catgraph-Signed': base64(new TextEncoder().encode(JSON.stringify(signed))) };
  }

  async #load() {
    if (!globalThis.crypto?.subtle) return; // a page without TLS
    const pair = await soon(kept()).catch(() => made()); // where nothing is kept, or not found in time: as long as the page
    const point = new Uint8Array(await crypto.subtle.exportKey('raw', pair.publicKey));
    const id = `k${(await sha256(point)).slice(0, 32)}`;
    this.#pair = pair;
    this.#point = base64(point);
    this.id = id;
  }
}

/** Rejects where it is not found in time. @template T @param {Promise<T>} found @returns {Promise<T>} */
function soon(found) {
  return Promise.race([found, new Promise((/** @type {(value: never) => void} */ _, reject) => { setTimeout(reject, KEPT_WITHIN_MS); })]);
}

/** @returns {Promise<CryptoKeyPair>} */
function made() {
  return crypto.subtle.generateKey(ALGORITHM, false, ['sign', 'verify']);
}

/** The key of this browser: the one that is kept, or a new one. @returns {Promise<CryptoKeyPair>} */
async function kept() {
  const database = await opened();
  try {
    const found = await done(database.transaction(KEYS).objectStore(KEYS).get(OWN));
    if (found) return found;
    const own = await made();
    const store = database.transaction(KEYS, 'readwrite').objectStore(KEYS);
    const meanwhile = await done(store.get(OWN)); // another page may have been faster
    if (meanwhile) return meanwhile;
    await done(store.put(own, OWN));
    return own;
  } finally {
    database.close();
  }
}

/** @returns {Promise<IDBDatabase>} */
function opened() {
  const request = indexedDB.open(DATABASE, 1);
  request.onupgradeneeded = () => request.result.createObjectStore(KEYS);
  return done(request);
}

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

/** In hex. @param {Uint8Array<ArrayBuffer>} bytes */
async function sha256(bytes) {
  return [...new Uint8Array(await crypto.subtle.digest('SHA-256', bytes))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
}

/** @param {Uint8Array} bytes */
function base64(bytes) {
  return btoa(String.fromCharCode(...bytes));
}
