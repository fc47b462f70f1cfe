// Adds somebody to the list of people. A removed name that is sent once more is that of the same person.

import { request } from './request.js';
import { Meant } from '../core/meant.js';

/** @typedef {import('../core/protocol-types.js').PeopleList} PeopleList */

export class AddPerson {
  #refused = '';
  #meant;

  /** @param {HTMLElement} keys which take no press until the refusal can be read */
  constructor(keys) {
    this.#meant = new Meant(keys);
  }

  /** Rejects with the reason of a refusal. @param {{name: string, role?: string}} person @param {Event} event @returns {Promise<PeopleList>} */
  async add(person, event) {
    const returns = person.name === this.#refused && this.#meant.by(event); // the refusal was read
    try {
      const list = await request('/api/people', { method: 'POST', body: { ...person, returns } });
      this.#refused = '';
      return list;
    } catch (error) {
      if (error instanceof Error && 'status' in error && error.status === 409) {
        this.#refused = person.name;
        this.#meant.moved();
      }
      throw error;
    }
  }
}
