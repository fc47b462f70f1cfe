// A job of the server on a recording while the operator waits: requested, followed, cancelled or fetched.

import { keptAt } from '../core/kept-at.js';
import { request, sentenceOf } from '../control/request.js';

/**
 * @typedef {object} Job as the server tells of it
 * @property {string} state waiting, working, done, failed or cancelled
 * @property {number | null} progress 0 to 1
 * @property {string | null} sentence
 * @property {string[]} [notes] what is not in it, and why
 * @property {boolean | null} [is_whole] false: something of the recording is not in it
 * @property {string | null} [recording] the recording it made
 */

const ASK_MS = 400;
const OVER = ['done', 'failed', 'cancelled'];

export class FileJob {
  #isGivenUp = false;
  /** @type {string | null} */
  id = null;

  /**
   * @param {string} path what is posted to
   * @param {object} body
   * @param {(job: Job) => void} onChange
   */
  constructor(path, body, onChange) {
    this.path = keptAt(path);
    this.exports = keptAt('/api/exports');
    this.body = body;
    this.onChange = onChange;
  }

  /** To its end. @returns {Promise<Job>} where it failed, its sentence has the reason; given up it is cancelled */
  async run() {
    try {
      const { job } = await request(this.path, { method: 'POST', body: this.body });
      this.id = String(job);
      let misses = 0;
      while (!this.#isGivenUp) {
        try {
          const job = /** @type {Job} */ (await request(`${this.exports}/${encodeURIComponent(this.id)}`));
          misses = 0;
          this.onChange(job);
          if (OVER.includes(job.state)) return job;
        } catch (error) {
          misses += 1; // a radio gap does not end what the server is at
          if (misses > 25) throw error;
        }
        await new Promise((resolve) => setTimeout(resolve, ASK_MS));
      }
    } catch (error) {
      if (!this.#isGivenUp) return { state: 'failed', progress: null, sentence: sentenceOf(error) };
    }
    if (this.id !== null) await request(`${this.exports}/${encodeURIComponent(this.id)}`, { method: 'DELETE' }).catch(() => {});
    return { state: 'cancelled', progress: null, sentence: null };
  }

  /** Nobody waits for it any more. */
  giveUp() {
    this.#isGivenUp = true;
  }

  /** Where what it made can be fetched. */
  get address() {
    return `${this.exports}/${encodeURIComponent(this.id ?? '')}/file`;
  }
}

/** Has the browser save what lies at an address of this server. @param {string} address */
export function save(address) {
  const link = document.createElement('a');
  link.href = address;
  link.download = '';
  link.click();
}
