// What an open check needs beyond the state frame: requested from the server once a second, its alarms with each new event.

import { ranked } from '../core/priority.js';
import { tilesOf } from './alarm-layout.js';
import { episodesOf, meantOf } from './check-layout.js';

const EVERY_MS = 1000;
const OLD_MS = 3500;
const MOST = 300; // events of one alarm

export class CheckFeed {
  /** @type {import('../core/protocol-types.js').CheckAnswer | null} */
  answer = null;
  /** When it came, by this phone's clock. */
  got_ms = 0;
  /** The last unit in which anything was measured. */
  unit = '';
  /** Why there is no answer, as a sentence. */
  problem = '';
  /** @type {import('./check-layout.js').Episode[] | null} */
  episodes = null;
  historyProblem = '';
  #since_ms = 0;
  #asked_ms = -Infinity;
  #isBusy = false;
  #isStopped = false;
  /** The server has no such check, or the replay is over: it is not requested again. */
  #isRefused = false;
  /** @type {number | null} the newest event that the history knows */
  #event = null;
  /** The replay and its leap; '' while live. */
  #source = '';
  /** The tile that was pressed: which of its checks is meant is known with the first answer. */
  #tile = '';

  /** @param {import('../core/store.js').Store} store @param {string} of id of a check, or "tile:" and the label of a tile @param {() => void} onChange */
  constructor(store, of, onChange) {
    this.store = store;
    this.onChange = onChange;
    this.id = of;
    if (of.startsWith('tile:')) {
      this.#tile = of.slice(5);
      this.id = this.#first(this.#tile);
    }
    this.#since_ms = store.now();
  }

  /** Of a tile the check whose alarm stands, else its first. @param {string} label */
  #first(label) {
    const { checks = [], alarms = [] } = this.store.frame ?? {};
    const ids = tilesOf(checks).find((tile) => tile.label === label)?.ids ?? [];
    return alarms.find(({ id, active }) => active && ids.includes(id))?.id ?? ids[0] ?? '';
  }

  /** What is shown is not of now: the server gave no answer for some seconds. */
  get isOld() {
    return this.store.now() - this.#since_ms > OLD_MS;
  }

  /** Called as often as the page draws. */
  look() {
    const now_ms = this.store.now();
    const { replay } = this.store.frame ?? {};
    const source = replay ? `${replay.token} ${replay.seek} ${replay.is_seeking}` : '';
    if (source !== this.#source) { // another moment, or another drive: nothing of the one before holds
      this.#source = source;
      this.#asked_ms = -Infinity;
      this.#event = this.episodes = null;
      this.#isRefused = false;
    }
    if (this.#isRefused) this.#since_ms = now_ms;
    else if (!this.#isBusy && now_ms - this.#asked_ms > EVERY_MS) void this.#fetch(now_ms);
    if (this.#event !== this.store.log.last && !this.store.replaying) void this.#history();
  }

  /** @param {string} path @param {Record<string, string>} [more] */
  #url(path, more = {}) {
    const { vehicle, replay } = this.store.frame ?? {};
    return `${path}?${new URLSearchParams({ ...(vehicle && !replay ? { vehicle } : {}), ...(replay && path.startsWith('/api/checks') ? { replay: replay.token } : {}), ...more })}`;
  }

  /** @param {number} now_ms */
  async #fetch(now_ms) {
    this.#isBusy = true;
    this.#asked_ms = now_ms;
    try {
      const response = await fetch(this.#url(`/api/checks/${encodeURIComponent(this.id)}`), { cache: 'no-store' });
      const body = await response.json();
      if (this.#isStopped) return;
      if (response.ok && body.id) this.#take(body);
      else {
        const isOver = response.status === 404 && this.store.frame?.replay != null;
        this.problem = isOver ? 'This replay is over.' : 'Nothing more is known of it.'; // an alarm of the server itself has no check
        this.#isRefused = isOver || response.status === 409;
        this.#since_ms = this.store.now();
      }
    } catch {
      // no answer: it grows old
    }
    this.#isBusy = false;
    if (!this.#isStopped) this.onChange();
  }

  /** @param {import('../core/protocol-types.js').CheckAnswer} answer */
  #take(answer) {
    const verdict = tilesOf(this.store.frame?.checks ?? []).find(({ label }) => label === this.#tile)?.verdict;
    const meant = this.#tile && verdict ? meantOf(answer.checks, verdict) : null;
    this.#tile = '';
    this.#since_ms = this.store.now();
    this.got_ms = Date.now();
    this.problem = '';
    if (meant && meant !== this.id && answer.verdict !== verdict) {
      this.id = meant;
      this.#asked_ms = -Infinity;
      this.#event = null;
      return;
    }
    [this.answer] = ranked([answer]);
    if (answer.history !== undefined) {
      this.episodes = answer.history && episodesOf(answer.history);
      this.historyProblem = answer.history ? '' : 'still being read';
    }
    this.unit = answer.measured?.unit || this.unit;
  }

  async #history() {
    this.#event = this.store.log.last;
    const { frame } = this.store;
    const driven_s = frame?.session.connected_for_s;
    /** @type {Record<string, string>} */
    const since = typeof driven_s === 'number' ? { since_ms: String(Math.max(0, Math.floor((frame?.server.time_ms ?? 0) - driven_s * 1000))) } : {};
    const { id } = this;
    try {
      const response = await fetch(this.#url('/api/log', { alarm: id, limit: String(MOST), ...since }), { cache: 'no-store' });
      const { events } = await response.json();
      if (this.#isStopped || id !== this.id) return;
      if (!response.ok) throw new Error('refused');
      this.episodes = episodesOf(events);
      this.historyProblem = '';
    } catch {
      this.historyProblem = 'not known: the server does not answer';
    }
    if (!this.#isStopped) this.onChange();
  }

  stop() {
    this.#isStopped = true;
  }
}
