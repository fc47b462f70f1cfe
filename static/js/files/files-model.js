// The recordings as the server lists them: asked for again while they are looked at, a page at a time, by what is wished for.

import { queryOf } from './files-layout.js';

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-layout.js').Listing} Listing
 * @typedef {import('./files-layout.js').Choice} Choice
 */

const PAGE = 50; // recordings a request
const MOST = 200; // as the server has it
const SILENT = 'The server does not answer.';

/**
 * Asks the server; a refusal is an Error with its sentence.
 * @param {string} path
 * @param {{method?: string, body?: object, signal?: AbortSignal}} [how]
 * @returns {Promise<any>}
 */
export async function request(path, { method = 'GET', body, signal } = {}) {
  /** @type {Response} */
  let answer;
  try {
    answer = await fetch(path, {
      method, cache: 'no-cache', ...(signal ? { signal } : {}), ...(body ? { body: JSON.stringify(body), headers: { 'content-type': 'application/json' } } : {}),
    });
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') throw error;
    throw new Error(SILENT);
  }
  const told = await answer.json().catch(() => null);
  if (!answer.ok) throw new Error(typeof told?.detail === 'string' ? told.detail : `The server refused the request (${answer.status}).`);
  return told;
}

/** The address of one recording. @param {string} id @param {string} [rest] */
export const addressOf = (id, rest = '') => `/api/recordings/${encodeURIComponent(id)}${rest}`;

/** @param {unknown} error */
export const sentenceOf = (error) => (error instanceof Error ? error.message : SILENT);

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
  isTrash = false;
  text = '';
  /** @type {Choice} */
  choice = { kind: 'all', value: '' };
  /** Another wish makes the answers to older ones worthless. */
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
   * @param {{text?: string, choice?: Choice, isTrash?: boolean}} wish
   */
  want(wish) {
    Object.assign(this, wish);
    this.#turn += 1;
    this.#isAsking = false;
    if (wish.isTrash !== undefined) {
      this.rows = [];
      this.next = null;
      this.at_ms = null;
    }
    return this.refresh();
  }

  /** The rows that are shown, as they are now. */
  async refresh() {
    await this.#ask(null, Math.min(MOST, Math.max(PAGE, this.rows.length)), (listing) => {
      const last = listing.recordings.at(-1);
      const beyond = listing.next && last ? this.rows.slice(this.rows.findIndex(({ id }) => id === last.id) + 1) : [];
      const isLonger = this.rows.length > MOST && beyond.length > 0; // pages beyond the last that is asked for stay as they were
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
      const listing = await request(`/api/${this.isTrash ? 'trash' : 'recordings'}?${query}`);
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

  /** @param {Recording} row @param {{title?: string, note?: string, tags?: string[]}} remarks @returns {Promise<Recording>} */
  async remark(row, remarks) {
    const said = await request(addressOf(row.id), { method: 'PATCH', body: remarks });
    await this.refresh();
    return said;
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
