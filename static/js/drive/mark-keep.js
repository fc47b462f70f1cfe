// Where marks are kept on this phone until the server has them: IndexedDB, else local storage without voice and photos, else
// the page's memory.

import { joined } from './mark-model.js';

const DATABASE = 'catgraph-marks';
const MARKS = 'marks';
const LISTED = 'catgraph.marks';
/** A browser that has not opened its storage by then has none for this visit [ms]. */
const OPEN_MS = 3000;

/** @typedef {import('./mark-model.js').Mark} Mark */
/** @typedef {'whole' | 'without parts' | 'memory'} Kept how much of a mark outlasts the page */

export class MarkKeep {
  /** @type {Promise<IDBDatabase | null>} */
  #opened;
  #storage;

  /** @param {Storage | null} storage @param {() => Promise<IDBDatabase>} [open] */
  constructor(storage, open = opened) {
    this.#storage = storage;
    this.#opened = soon(Promise.resolve().then(open)).catch((error) => {
      console.info('Marks are kept without a database:', error);
      return null;
    });
  }

  /** @returns {Promise<Mark[]>} those of all pages and visits */
  async all() {
    const database = await this.#opened;
    /** @type {Mark[]} */
    const kept = database ? await done(database.transaction(MARKS).objectStore(MARKS).getAll()).catch(() => []) : [];
    const all = new Map(kept.map((mark) => [mark.id, mark]));
    for (const mark of this.#listed()) all.set(mark.id, joined(all.get(mark.id) ?? mark, mark));
    return [...all.values()];
  }

  /** Raises the database's error where it cannot be read. @param {string} id @returns {Promise<Mark | null>} null: there is none */
  async get(id) {
    const database = await this.#opened;
    const kept = database ? await done(database.transaction(MARKS).objectStore(MARKS).get(id)) : undefined;
    return this.#newest(id, kept);
  }

  /**
   * Change a mark as it is kept by now, for another page may have changed it too.
   * @param {string} id
   * @param {(mark: Mark) => Mark | null} change null drops it; called again where the storage is full
   * @param {Mark} own as this page has it
   * @param {boolean} [wasKept] where there is none any more, another page dropped it
   * @returns {Promise<{mark: Mark | null, kept: Kept}>} what it became, once it is on the disk
   */
  async change(id, change, own, wasKept = false) {
    const database = await this.#opened;
    for (const isWhole of database ? [true, false] : []) { // full: the mark itself is small
      try {
        const mark = await this.#written(/** @type {IDBDatabase} */ (database), id, (kept) => turned(change, this.#newest(id, kept), wasKept ? null : own, own), isWhole);
        if (!mark) this.#unlist(id);
        return { mark, kept: isWhole || !hasBlobs(mark) ? 'whole' : 'without parts' };
      } catch {
        // refused altogether: listed below
      }
    }
    const mark = turned(change, this.#newest(id), wasKept && !database ? null : own, own);
    if (!mark) {
      this.#unlist(id);
      return { mark, kept: 'whole' };
    }
    if (!this.#list([...this.#listed().filter((other) => other.id !== id), withoutParts(mark)])) return { mark, kept: 'memory' };
    return { mark, kept: hasBlobs(mark) ? 'without parts' : 'whole' };
  }

  /**
   * Reads and writes in one transaction.
   * @param {IDBDatabase} database
   * @param {string} id
   * @param {(kept: Mark | undefined) => Mark | null} change
   * @param {boolean} isWhole
   * @returns {Promise<Mark | null>}
   */
  #written(database, id, change, isWhole) {
    return new Promise((resolve, reject) => {
      const transaction = database.transaction(MARKS, 'readwrite', { durability: 'strict' });
      /** @type {Mark | null} */
      let mark = null;
      transaction.oncomplete = () => resolve(mark);
      transaction.onabort = transaction.onerror = () => reject(transaction.error);
      const marks = transaction.objectStore(MARKS);
      const request = marks.get(id);
      request.onsuccess = () => {
        mark = change(request.result);
        if (mark) marks.put(isWhole ? mark : withoutParts(mark));
        else marks.delete(id);
      };
    });
  }

  /** @param {string} id @param {Mark} [kept] in the database @returns {Mark | null} */
  #newest(id, kept) {
    const listed = this.#listed().find((mark) => mark.id === id);
    return kept && listed ? joined(kept, listed) : kept ?? listed ?? null;
  }

  /** @param {string} id */
  #unlist(id) {
    const listed = this.#listed();
    if (listed.some((mark) => mark.id === id)) this.#list(listed.filter((mark) => mark.id !== id));
  }

  /** @returns {Mark[]} */
  #listed() {
    try {
      const listed = JSON.parse(this.#storage?.getItem(LISTED) ?? '[]');
      return Array.isArray(listed) ? listed.filter((mark) => typeof mark?.id === 'string') : [];
    } catch {
      return [];
    }
  }

  /** @param {Mark[]} marks */
  #list(marks) {
    try {
      if (!this.#storage) return false;
      if (marks.length) this.#storage.setItem(LISTED, JSON.stringify(marks));
      else this.#storage.removeItem(LISTED);
      return true;
    } catch {
      return false;
    }
  }
}

/** @param {(mark: Mark) => Mark | null} change @param {Mark | null} kept @param {Mark | null} first where none is kept @param {Mark} own @returns {Mark | null} */
function turned(change, kept, first, own) {
  const was = kept ? joined(kept, own) : first;
  const mark = was && change(was);
  return mark && { ...mark, turn: (was.turn ?? 0) + 1 };
}

/** @param {Mark | null} mark */
function hasBlobs(mark) {
  return Boolean(mark?.voice?.blob || mark?.photo?.blob);
}

/** @param {Mark} mark @returns {Mark} */
function withoutParts(mark) {
  const bare = (/** @type {import('./mark-model.js').Part | null} */ part) => part && { ...part, blob: null };
  return { ...mark, voice: bare(mark.voice), photo: bare(mark.photo) };
}

/** @returns {Promise<IDBDatabase>} */
function opened() {
  const request = indexedDB.open(DATABASE, 1);
  request.onupgradeneeded = () => request.result.createObjectStore(MARKS, { keyPath: 'id' });
  return done(request);
}

/** @template T @param {Promise<T>} wanted @returns {Promise<T>} */
function soon(wanted) {
  return Promise.race([wanted, new Promise((_, reject) => { setTimeout(() => reject(new Error('The storage did not open in time')), OPEN_MS); })]);
}

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
