// What the page asked the server for, until it is answered.

/** A command is for now: without an answer by then it counts as refused [ms]. */
const REPLY_MS = 4000;

/**
 * @template {string} Kind
 * @typedef {import('./protocol-types.js').PageMessage extends infer One ? One extends {kind: Kind} ? Omit<One, 'kind' | 'id'> : never : never} FieldsOf
 *   what a command of this kind says
 */

/**
 * @typedef {{ok: boolean, reason?: string, suggestion?: string, version?: number, isConflict?: boolean, heldBy?: string}} Answer suggestion: an address
 *   that would do; version: of the settings, once changed; isConflict: somebody else changed them in between; heldBy: who is in control instead
 */

export class Requests {
  #asked = 0;
  /** @type {Map<string, (answer: Answer) => void>} */
  #waiting = new Map();
  #send;
  #refused;

  /**
   * @param {(message: object) => boolean} send false: it could not be sent
   * @param {(answer: Answer) => void} refused called for each that was sent and refused
   */
  constructor(send, refused) {
    this.#send = send;
    this.#refused = refused;
  }

  /**
   * Ask the server for something. It is refused at once where the server is not there: a command is never kept for later.
   * @template {import('./protocol-types.js').PageMessage['kind']} Kind
   * @param {Kind} kind
   * @param {FieldsOf<Kind>} fields
   * @param {number} [within_ms]
   * @returns {Promise<Answer>}
   */
  ask(kind, fields, within_ms = REPLY_MS) {
    this.#asked += 1;
    const id = `p${this.#asked}`;
    if (!this.#send({ kind, id, ...fields })) return Promise.resolve({ ok: false, reason: 'Not sent: the server does not answer.' });
    return new Promise((resolve) => {
      this.#waiting.set(id, resolve);
      setTimeout(() => this.#settle(id, { ok: false, reason: 'The server did not answer in time.' }), within_ms);
    });
  }

  /** The server answered one of them. @param {import('./protocol-types.js').Reply} reply */
  answered(reply) {
    this.#settle(reply.id, answerOf(reply));
  }

  /** The connection broke: none of them is answered any more. */
  broke() {
    for (const id of [...this.#waiting.keys()]) this.#settle(id, { ok: false, reason: 'The connection to the server broke.' });
  }

  /**
   * @param {string} id
   * @param {Answer} answer
   */
  #settle(id, answer) {
    if (!answer.ok && this.#waiting.has(id)) this.#refused(answer);
    this.#waiting.get(id)?.(answer);
    this.#waiting.delete(id);
  }
}

/**
 * @param {import('./protocol-types.js').Reply} reply
 * @returns {Answer}
 */
function answerOf({ ok, reason, problem, version, conflict, held_by }) {
  return {
    ok, ...(reason ? { reason } : {}), ...(problem?.suggestion ? { suggestion: problem.suggestion } : {}),
    ...(version === undefined ? {} : { version }), ...(conflict ? { isConflict: true } : {}), ...(held_by ? { heldBy: held_by } : {}),
  };
}
