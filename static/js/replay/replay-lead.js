// Orders to the replay of this page: no more of them a second than a page may send, and none while the server opens it anew.

import { LEADS_A_S } from '../core/socket.js';

/**
 * @typedef {import('../core/requests.js').FieldsOf<'replay'>} Order
 * @typedef {{ok: boolean, reason?: string, isBroken?: boolean}} Outcome
 */

const LEFT = { ok: true }; // of a replay that was left meanwhile, nothing is refused

export class ReplayLead {
  /** The server opens it anew: for a new connection, or to judge it otherwise. */
  #isReopening = false;
  #isOver = false;
  /** Orders that wait for that. @type {((_: void) => void)[]} */
  #waiting = [];

  /** @param {Pick<import('../core/store.js').Store, 'ask' | 'socket'>} store */
  constructor(store) {
    this.store = store;
  }

  /** No order reaches the replay now. */
  get isAway() {
    return !this.store.socket.isOpen || this.#isReopening;
  }

  /** Have it carried out, once the replay is there. @param {Order} order @returns {Promise<Outcome>} */
  async order(order) {
    let answer;
    do {
      if (this.isAway) await new Promise((go) => this.#waiting.push(go));
      await new Promise((/** @type {(_: void) => void} */ go) => this.store.socket.inTurn(LEADS_A_S, go, 'replay'));
      if (this.#isOver) return LEFT;
      answer = await this.store.ask('replay', order);
    } while (!answer.ok && this.isAway && !this.#isOver);
    return answer;
  }

  /**
   * Open it anew, and let go what waits for that.
   * @template {Outcome} O
   * @param {() => Promise<O>} open resolves once the server has answered
   * @returns {Promise<O>}
   */
  async reopen(open) {
    this.#isReopening = true;
    const answer = await open();
    this.#isReopening = Boolean(answer.isBroken); // then the next connection opens it
    if (!this.isAway) this.#goOn();
    return answer;
  }

  /** The replay is left. */
  end() {
    this.#isOver = true;
    this.#goOn();
  }

  #goOn() {
    for (const go of this.#waiting.splice(0)) go();
  }
}
