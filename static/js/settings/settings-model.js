// The settings of one vehicle on this page: what is in force, what was requested and is not confirmed yet, how to take it back.

import { maybe } from '../core/outcome.js';
import { DEFAULTS, changeLines, changeTo } from './settings-layout.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('./settings-layout.js').Settings} Settings
 * @typedef {import('./settings-layout.js').Change} Change
 * @typedef {{ok: boolean, reason?: string}} Outcome
 * @typedef {import('../core/protocol-types.js').TopicOffer} Candidate
 * @typedef {{value: number, version: number | null}} Pending version: which version confirms it; null: not answered yet
 */

const FETCH_MS = 4000;
const AGAIN_MS = 2000;
/** Changes of one thing that follow one another so soon are one change, to be taken back as a whole [ms]. */
const ONE_CHANGE_MS = 2000;
const GONE = 'Not sent: the server does not answer.';

/** @type {WeakMap<Store, SettingsModel>} */
const models = new WeakMap();

/**
 * The settings of the vehicle that this store watches.
 * @param {Store} store
 */
export function settingsOf(store) {
  const model = models.get(store) ?? new SettingsModel(store);
  models.set(store, model);
  return model;
}

export class SettingsModel {
  /** @type {Settings | null} */
  body = null;
  /** Why the settings are not known, as a sentence. @type {string | null} */
  problem = null;
  /** @type {{base: Settings, version: number, of: string, at_ms: number} | null} */
  #undo = null;
  /** @type {Map<string, Pending>} */
  #pending = new Map();
  /** What of the server `body` was true for. */
  #fetched = '';
  /** @type {Promise<void> | null} */
  #loading = null;
  /** The last change that was requested, answered or not. @type {Promise<void>} */
  #last = Promise.resolve();
  #tried_ms = -Infinity;
  #boot = '';
  /** The version that stands on the glass. */
  #seen = 0;

  /** @param {Store} store */
  constructor(store) {
    this.store = store;
    store.on('switch', () => this.#forget());
  }

  /** Another car is shown: nothing of the one before is requested of it, shown for it or taken back. */
  #forget() {
    this.body = this.problem = this.#undo = null;
    this.#pending.clear();
    this.#fetched = this.#boot = '';
    this.#seen = 0;
    this.#tried_ms = -Infinity;
  }

  /** May anything be changed now? */
  get isOpen() {
    return this.body !== null && !this.store.isSilent;
  }

  /** @param {string} name @returns {number | null} what is in force, in SI */
  inForce(name) {
    return this.store.limit(name) ?? this.body?.values[name] ?? null;
  }

  /** The topics and units that somebody chose: for the car, or in a replay for that replay. */
  get chosen() {
    const { body, store } = this;
    return store.replaying ? store.judgedBy : { topics: body?.topics ?? {}, units: body?.units ?? {} };
  }

  /** The requested value that is not confirmed. @param {string} name */
  pending(name) {
    return this.#pending.get(name)?.value ?? null;
  }

  /** Called as often as the page draws: forgets what is confirmed, and fetches what another page changed. */
  look() {
    const { frame } = this.store;
    if (!frame || this.store.isSilent) return;
    const { settings_version: version = 0 } = frame.session;
    const profile = frame.session.profile ?? '';
    if (this.#boot !== frame.server.boot) {
      this.#boot = frame.server.boot;
      this.#seen = 0;
    }
    this.#seen = Math.max(this.#seen, version);
    for (const [name, { version: by }] of this.#pending) if (by !== null && version >= by) this.#pending.delete(name);
    if (this.#key(version, profile) !== this.#fetched && this.store.now() - this.#tried_ms > (this.problem ? AGAIN_MS : 100)) void this.load();
  }

  /** Fetches the settings anew. */
  load() {
    this.#loading ??= this.#load().finally(() => { this.#loading = null; });
    return this.#loading;
  }

  async #load() {
    const { frame } = this.store;
    if (!frame) return;
    this.#tried_ms = this.store.now();
    const key = this.#key(frame.session.settings_version ?? 0, frame.session.profile ?? '');
    const { vehicle } = this.store;
    try {
      const body = await fetched(this.#path('/api/settings'));
      if (vehicle === this.store.vehicle) this.#adopt(body, key);
    } catch (error) {
      if (vehicle === this.store.vehicle) this.problem = sentenceOf(error);
    }
  }

  /**
   * Puts a change in force, if nobody else changed anything since it was looked at.
   * @param {Change} change
   * @param {string} [of] what is changed; several changes of one thing in a row are taken back together
   * @returns {Promise<Outcome>}
   */
  set(change, of = '') {
    if (this.store.replaying && !change.values) return judgeBy(change);
    /** @type {Map<string, Pending>} */
    const changes = new Map();
    for (const [name, wanted] of Object.entries(change.values ?? {})) {
      const value = wanted ?? this.body?.defaults[name];
      if (value !== undefined) changes.set(name, { value, version: null });
    }
    for (const [name, pending] of changes) this.#pending.set(name, pending);
    // One after the other: the next names the version that this one makes.
    const { vehicle } = this.store;
    const outcome = this.#last.then(() => this.#set(change, of, vehicle));
    this.#last = outcome.then(({ ok }) => {
      for (const [name, pending] of changes) {
        pending.version = this.#seen;
        if (!ok && this.#pending.get(name) === pending) this.#pending.delete(name);
      }
    });
    return this.#last.then(() => outcome);
  }

  /** @param {Change} change @param {string} of @param {string} vehicle whose settings were looked at @returns {Promise<Outcome>} */
  async #set(change, of, vehicle) {
    const base = await this.#current();
    if (vehicle !== this.store.vehicle) return { ok: false, reason: 'Not changed: another car is shown now.' };
    if (!base) return { ok: false, reason: GONE };
    const answer = await this.store.ask('set', { ...change, version: this.#seen });
    if (!answer.ok) {
      if (answer.isConflict) await this.load();
      return { ok: false, reason: answer.reason ?? 'Refused.' };
    }
    this.#confirmed(answer.version ?? this.#seen, base, of);
    return { ok: true };
  }

  /**
   * All settings from a file.
   * @param {string} toml
   * @returns {Promise<Outcome>}
   */
  async replace(toml) {
    const base = await this.#current();
    if (!base) return { ok: false, reason: GONE };
    try {
      const name = this.store.name.replace(/[^\u0020-\u00ff]/g, '');
      const { fence, frame, seal, vehicle } = this.store;
      const signed = await seal.headers({ kind: 'import', ...(fence === null ? {} : { fence }) }, { toml }, vehicle, frame?.server.challenge);
      const body = await fetched(this.#path('/api/settings.toml'), { method: 'PUT', body: toml, headers: { 'X-Catgraph-Name': name, ...signed } });
      if (body.version > base.version) this.#confirmed(body.version, base, '');
      this.body = body;
      return { ok: true };
    } catch (error) {
      return { ok: false, reason: error instanceof Refusal ? error.message : maybe(sentenceOf(error)) };
    }
  }

  /** The settings as a file. @returns {Promise<string>} raises an Error whose message is a sentence */
  async toml() {
    if (this.store.isSilent) throw new Error(GONE);
    try {
      return (await answered(this.#path('/api/settings.toml'))).text();
    } catch (error) {
      throw new Error(sentenceOf(error));
    }
  }

  /**
   * The topics whose type can be read as each signal, and how many the car has; null: its bridge does not say.
   * @returns {Promise<{candidates: Record<string, Candidate[]> | null, unmapped: number}>}
   */
  async candidates() {
    const { replay } = this.store.frame ?? {};
    const { candidates, topics } = await fetched(`${this.#path('/api/signals')}${replay ? `&replay=${replay.token}` : ''}`);
    return { candidates, unmapped: topics.length };
  }

  /** What would be taken back, a line each; empty: nothing. */
  get undoLines() {
    return this.#undo && this.body ? this.lines(changeTo(this.body, this.#undo.base)) : [];
  }

  /** Takes the last change of this page back, if nobody changed anything since. @returns {Promise<Outcome>} */
  async undo() {
    const undo = this.#undo;
    if (!undo || !this.body) return { ok: false, reason: 'There is nothing to undo.' };
    await this.#current();
    if (this.body.version < undo.version) return { ok: false, reason: this.problem ?? 'The server has not confirmed the change yet.' };
    this.#undo = null;
    if (this.#seen !== undo.version) return { ok: false, reason: 'Somebody else changed the settings since. Check them again.' };
    const outcome = await this.set(changeTo(this.body, undo.base));
    this.#undo = outcome.ok ? null : undo;
    return outcome;
  }

  /** What going back to all defaults changes, a line each. */
  get resetLines() {
    return this.body ? this.lines(changeTo(this.body, DEFAULTS)) : [];
  }

  /** Everything back to its default. @returns {Promise<Outcome>} */
  async reset() {
    return this.body ? this.set(changeTo(this.body, DEFAULTS)) : { ok: false, reason: GONE };
  }

  /** A change as text. @param {Change} change */
  lines(change) {
    return this.body ? changeLines(this.body, change, (signal) => this.store.signal(signal)?.label ?? signal) : [];
  }

  /** The settings as they are now, not as they were before the last change; null where the server does not answer. */
  async #current() {
    for (let tries = 0; tries < 2 && this.body && this.body.version < this.#seen && !this.store.isSilent; tries += 1) await this.load();
    return this.store.isSilent ? null : this.body;
  }

  /**
   * @param {number} version
   * @param {Settings} base
   * @param {string} of
   */
  #confirmed(version, base, of) {
    const now_ms = this.store.now();
    const isMore = this.#undo !== null && of !== '' && this.#undo.of === of && now_ms - this.#undo.at_ms < ONE_CHANGE_MS;
    this.#undo = { base: isMore && this.#undo ? this.#undo.base : base, version, of, at_ms: now_ms };
    this.#seen = Math.max(this.#seen, version);
  }

  /** @param {Settings} body @param {string} key */
  #adopt(body, key) {
    this.body = body;
    this.problem = null;
    this.#fetched = key;
    this.#seen = Math.max(this.#seen, body.version);
    if (this.#undo && body.version > this.#undo.version) this.#undo = null; // another page's change came after it
  }

  /** @param {number} version @param {string} profile */
  #key(version, profile) {
    return `${this.store.frame?.server.boot} ${version} ${profile}`;
  }

  /** @param {string} path */
  #path(path) {
    const vehicle = this.store.frame?.vehicle;
    return vehicle ? `${path}?vehicle=${encodeURIComponent(vehicle)}` : path;
  }
}

/** @param {string} path @param {RequestInit} [options] @returns {Promise<any>} */
async function fetched(path, options) {
  return (await answered(path, options)).json();
}

/** @param {string} path @param {RequestInit} [options] */
async function answered(path, options = {}) {
  const answer = await fetch(path, { ...options, signal: AbortSignal.timeout(FETCH_MS) });
  if (answer.ok) return answer;
  const problem = await answer.json().catch(() => null);
  throw new Refusal(typeof problem?.detail === 'string' ? problem.detail : `The server answers ${answer.status}.`);
}

/** The server's own message. */
class Refusal extends Error {}

/** @param {unknown} error */
function sentenceOf(error) {
  return error instanceof Refusal ? error.message : 'The server did not answer in time.';
}

/** A replay is judged anew by a choice: the settings are those of the live car. @param {Change} change @returns {Promise<Outcome>} */
async function judgeBy(change) {
  const { ok, reason = 'Refused.' } = await (await import('../replay/replay.js')).judgeBy(change);
  return ok ? { ok } : { ok, reason };
}
