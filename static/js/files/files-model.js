// The recordings as the server lists them: requested again while they are in view, a page at a time, by the search.

import { request, sentenceOf } from '../control/request.js';
import { keptVehicle } from '../core/kept-at.js';
import { queryOf } from './files-layout.js';
import { listingOf, storedQueryOf } from './stored-list.js';

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-layout.js').Listing} Listing
 * @typedef {import('./files-layout.js').Choice} Choice
 */

const PAGE = 50; // recordings a request
const MOST = 200; // as the server has it
const NO_LIST = 404;
const ELSEWHERE = [NO_LIST, 422, 503]; // no list here, no car named at a node, the car's agent does not answer

/** The address of one recording. @param {string} id @param {string} [rest] */
export const addressOf = (id, rest = '') => `/api/recordings/${encodeURIComponent(id)}${rest}`;

/** Whether this server has a store that it could list. */
const hasStore = () => globalThis.document?.documentElement.dataset['stored'] !== undefined;

export class FilesModel {
  /** @type {Recording[]} */
  rows = [];
  /** The newest answer, without its rows; of the trash it has less. @type {Partial<Listing>} */
  listing = {};
  /** Where the page after the last row begins. @type {string | null} */
  next = null;
  /** Why there is no newer list. @type {string | null} */
  problem = null;
  /** When the list was last true, by this phone's clock [ms]. @type {number | null} */
  at_ms = null;
  /** The name of the store, where the list is of what agents stored there and not of recordings that can be reached. @type {string | null} */
  inStore = null;
  isTrash = false;
  text = '';
  /** @type {Choice} */
  choice = { kind: 'all', value: '' };
  /** Counts the searches: an answer to an older search is dropped. */
  #turn = 0;
  #isAsking = false;

  /** @param {() => void} onChange */
  constructor(onChange) {
    this.onChange = onChange;
  }

  get isFiltered() {
    return this.text.trim() !== '' || this.choice.kind !== 'all';
  }

  /**
   * Other recordings are wanted.
   * @param {{text?: string, choice?: Choice, isTrash?: boolean}} search
   */
  want(search) {
    Object.assign(this, search);
    this.#turn += 1;
    this.#isAsking = false;
    if (search.isTrash !== undefined) {
      this.rows = [];
      this.next = null;
      this.at_ms = null;
    }
    return this.refresh();
  }

  /** Clears the list; the answer to a request under way is dropped. */
  forget() {
    this.#turn += 1;
    this.#isAsking = false;
    this.rows = [];
    this.listing = {};
    this.isTrash = false;
    this.next = this.at_ms = this.problem = null;
    this.onChange();
  }

  /** The rows that are shown, as they are now. */
  async refresh() {
    await this.#ask(null, Math.min(MOST, Math.max(PAGE, this.rows.length)), (listing) => {
      const last = listing.recordings.at(-1);
      const beyond = listing.next && last ? this.rows.slice(this.rows.findIndex(({ id }) => id === last.id) + 1) : [];
      const isLonger = this.rows.length > MOST && beyond.length > 0; // pages beyond the last requested one stay as they were
      this.rows = isLonger ? [...listing.recordings, ...beyond] : listing.recordings;
      if (!isLonger) this.next = listing.next;
    });
  }

  /** The page after the last row. */
  async more() {
    await this.#ask(this.next, PAGE, (listing) => {
      const known = new Set(this.rows.map(({ id }) => id));
      this.rows = [...this.rows, ...listing.recordings.filter(({ id }) => !known.has(id))];
      this.next = listing.next;
    });
  }

  /**
   * @param {string | null} cursor
   * @param {number} limit
   * @param {(listing: Listing) => void} take
   */
  async #ask(cursor, limit, take) {
    if (this.#isAsking) return;
    const turn = this.#turn;
    this.#isAsking = true;
    try {
      const query = queryOf({ text: this.isTrash ? '' : this.text, choice: this.isTrash ? { kind: 'all', value: '' } : this.choice, cursor, limit }, Date.now());
      const listing = await this.#list(query, cursor, limit);
      if (turn !== this.#turn) return;
      take(listing);
      const { recordings: _, ...rest } = listing;
      this.listing = this.isTrash ? { ...this.listing, trash: listing.all } : rest;
      this.problem = null;
      this.at_ms = Date.now();
    } catch (error) {
      if (turn === this.#turn) this.problem = sentenceOf(error);
    } finally {
      if (turn === this.#turn) {
        this.#isAsking = false;
        this.onChange();
      }
    }
  }

  /**
   * The list of the server, or of the store where the server has none.
   * @param {string} query
   * @param {string | null} cursor
   * @param {number} limit
   * @returns {Promise<Listing>}
   */
  async #list(query, cursor, limit) {
    try {
      const listing = await request(`/api/${this.isTrash ? 'trash' : 'recordings'}?${query}`);
      this.inStore = null;
      return listing;
    } catch (error) {
      const status = /** @type {{status?: number}} */ (error).status ?? 0;
      if (this.isTrash || !hasStore() || !ELSEWHERE.includes(status)) throw error;
      const wanted = storedQueryOf(this.inStore === null ? null : cursor, limit, this.choice, keptVehicle());
      const stored = await request(`/api/stored?${wanted}`).catch(() => {
        throw error; // nor does the store answer
      });
      this.inStore = stored.store;
      return listingOf(stored, status === NO_LIST ? null : sentenceOf(error));
    }
  }

  /** @param {Recording} row @param {{title?: string, note?: string, weather?: string, tags?: string[]}} remarks @returns {Promise<Recording>} */
  async remark(row, remarks) {
    const changed = await request(addressOf(row.id), { method: 'PATCH', body: remarks });
    await this.refresh();
    return changed;
  }

  /** @param {string} id */
  async remove(id) {
    await request(addressOf(id), { method: 'DELETE' });
    await this.refresh();
  }

  /** @param {string} id */
  async restore(id) {
    await request(`/api/trash/${encodeURIComponent(id)}/restore`, { method: 'POST' });
    await this.refresh();
  }

  /** For good: one, or with null all of the trash. @param {string | null} id */
  async destroy(id) {
    await request(id === null ? '/api/trash' : `/api/trash/${encodeURIComponent(id)}`, { method: 'DELETE' });
    await this.refresh();
  }
}
