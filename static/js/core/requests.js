// The requests of the page until they are answered, and the outcome of those that were not answered.

import { maybe, withCut } from './outcome.js';

/** A command is for now: without an answer by then it is not known what became of it [ms]. */
const REPLY_MS = 4000;
/** The outcome of an unanswered command is queried so often [ms], and for so long: a session knows it for 120 s. */
const LOOKS_EVERY_MS = 1500;
const LOOKS_FOR_MS = 100_000;
/** So many of them at most; the oldest is given up. */
const MOST_LOST = 20;

/**
 * @template {string} Kind
 * @typedef {import('./protocol-types.js').PageMessage extends infer One ? One extends {kind: Kind} ? Omit<One, 'kind' | 'id'> : never : never} FieldsOf
 *   the fields of a command of this kind
 */

/**
 * @typedef {import('./outcome.js').Outcome} Outcome
 * @typedef {import('./outcome.js').Became} Became
 * @typedef {{ok: boolean, reason?: string, outcome?: Outcome, suggestion?: string, version?: number, isConflict?: boolean, heldBy?: string, isBroken?: boolean}} Answer
 *   outcome: of one that is not ok; where it is left out, it was refused. suggestion: an address that would do; version: of the settings, once changed;
 *   isConflict: somebody else changed them in between; heldBy: who is in control instead; isBroken: nobody refused, the connection broke or was not there
 * @typedef {import('./outcome.js').Cut} Cut
 * @typedef {{kind: string, became: Became, reason: string, cut: Cut | null}} Found what became of a command that was not answered
 * @typedef {{kind: string, vehicle: unknown, at_ms: number, cut: Cut | null}} Lost cut: where, where known
 * @typedef {{kind: string, vehicle: unknown, at_ms: number, isSent: boolean, resolve: (answer: Answer) => void}} Waiting at_ms: when it was requested
 */

const NOT_SENT = { ok: false, outcome: /** @type {const} */ ('not_delivered'), reason: 'Not sent: the server does not answer.', isBroken: true };
const NOT_SIGNED = { ok: false, outcome: NOT_SENT.outcome, reason: 'Not sent: this device could not sign it.' };
/** Kinds whose loss changes nothing, or that are sent again until they are answered. */
const ONLY_OF_PAGE = new Set(['replay', 'outcome', 'mark', 'remove_mark']);

export class Requests {
  #count = 0;
  /** Begins each id: those of another visit of this page are others. */
  #visit = [...crypto.getRandomValues(new Uint8Array(4))].map((byte) => byte.toString(16).padStart(2, '0')).join('');
  /** @type {Map<string, Waiting>} */
  #waiting = new Map();
  /** By id. @type {Map<string, Lost>} */
  #lost = new Map();
  #looked_ms = -Infinity;
  #send;
  #refused;
  #seal;
  #found;

  /**
   * @param {(message: object) => boolean} send false: it could not be sent
   * @param {(answer: Answer) => void} refused called for each that was sent and refused
   * @param {(message: {kind: string, id: string}) => Promise<object> | null} [seal] the message as it is sent, where it must be signed first
   * @param {(found: Found) => void} [found] called with what became of one that was not answered
   */
  constructor(send, refused, seal = () => null, found = () => {}) {
    this.#send = send;
    this.#refused = refused;
    this.#seal = seal;
    this.#found = found;
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
    this.#count += 1;
    const id = `${this.#visit}-${this.#count}`;
    const message = { kind, id, ...fields };
    const asked_ms = performance.now();
    const sealed = this.#seal(message);
    if (sealed === null && !this.#send(message)) return Promise.resolve(NOT_SENT);
    const answer = new Promise((/** @type {(answer: Answer) => void} */ resolve) => {
      const { vehicle = null } = /** @type {{vehicle?: unknown}} */ (fields);
      this.#waiting.set(id, { kind, vehicle, at_ms: asked_ms, isSent: sealed === null, resolve });
      setTimeout(() => this.#lose(id, 'The server did not answer in time.', NOT_SIGNED), within_ms);
    });
    sealed?.then((whole) => this.#sendSealed(id, whole), () => this.#settle(id, NOT_SIGNED));
    return answer;
  }

  /** @param {string} id @param {object} message */
  #sendSealed(id, message) {
    const waiting = this.#waiting.get(id);
    if (!waiting) return; // given up meanwhile
    waiting.isSent = this.#send(message);
    if (!waiting.isSent) this.#settle(id, NOT_SENT);
  }

  /** The server answered one of them. @param {import('./protocol-types.js').Reply} reply */
  answered(reply) {
    if (reply.id.endsWith('?')) {
      if (reply.ok && reply.became && reply.became !== 'under_way') this.#tell(reply.id.slice(0, -1), reply.became, reply.reason);
      return;
    }
    const answer = answerOf(reply);
    const waiting = this.#waiting.get(reply.id);
    if (answer.outcome === 'unknown' && waiting) this.#keep(reply.id, waiting, reply.cut ?? null);
    if (waiting) this.#settle(reply.id, answer);
    else this.#late(reply.id, answer, reply.cut ?? null);
  }

  /** An answer that came when the request was given up: only the cut that it states counts. @param {string} id @param {Answer} answer @param {Cut | null} cut */
  #late(id, { ok, outcome, reason }, cut) {
    const lost = this.#lost.get(id);
    if (!lost) return;
    lost.cut = cut;
    if (outcome !== 'unknown') this.#tell(id, ok ? 'done_late' : outcome === 'not_delivered' ? 'not_delivered' : 'refused', reason);
  }

  /** The connection broke: none of them is answered any more. */
  broke() {
    for (const id of [...this.#waiting.keys()]) this.#lose(id, 'The connection to the server broke.', NOT_SENT, true);
  }

  /** Another car is shown: the outcome of commands to the one before is not queried here. */
  forget() {
    this.#lost.clear();
  }

  /** Time passes: ask what became of those that were not answered. @param {number} now_ms */
  look(now_ms) {
    if (this.#lost.size === 0 || now_ms - this.#looked_ms < LOOKS_EVERY_MS) return;
    this.#looked_ms = now_ms;
    for (const [id, { at_ms, vehicle }] of this.#lost) {
      if (now_ms - at_ms > LOOKS_FOR_MS) this.#tell(id, 'not_known');
      else this.#send({ kind: 'outcome', id: `${id}?`, of: id, ago_s: (now_ms - at_ms) / 1000, ...(vehicle === null ? {} : { vehicle }) });
    }
  }

  /** Nothing came. @param {string} id @param {string} why @param {Answer} [unsent] of one that was not signed yet @param {boolean} [isBroken] */
  #lose(id, why, unsent = NOT_SENT, isBroken = false) {
    const waiting = this.#waiting.get(id);
    if (!waiting) return;
    if (!waiting.isSent) return this.#settle(id, unsent);
    this.#keep(id, waiting, 'page-server');
    this.#settle(id, { ok: false, outcome: 'unknown', reason: withCut(maybe(why), 'unknown', 'page-server'), ...(isBroken ? { isBroken } : {}) });
  }

  /** @param {string} id @param {Waiting} waiting @param {Cut | null} cut */
  #keep(id, { kind, vehicle, at_ms }, cut) {
    if (ONLY_OF_PAGE.has(kind)) return;
    this.#lost.set(id, { kind, vehicle, at_ms, cut });
    if (this.#lost.size > MOST_LOST) this.#lost.delete([...this.#lost.keys()][0] ?? '');
  }

  /** @param {string} id @param {Became} became @param {string} [reason] */
  #tell(id, became, reason = '') {
    const lost = this.#lost.get(id);
    this.#lost.delete(id);
    if (lost) this.#found({ kind: lost.kind, became, reason, cut: lost.cut });
  }

  /**
   * @param {string} id
   * @param {Answer} answer
   */
  #settle(id, answer) {
    const waiting = this.#waiting.get(id);
    this.#waiting.delete(id);
    if (!answer.ok && waiting) this.#refused(answer);
    waiting?.resolve(answer);
  }
}

/**
 * @param {import('./protocol-types.js').Reply} reply
 * @returns {Answer}
 */
function answerOf({ ok, reason, outcome, cut, problem, version, conflict, held_by }) {
  return {
    ok, ...(reason ? { reason: cut && outcome ? withCut(reason, outcome, cut) : reason } : {}), ...(outcome ? { outcome } : {}), ...(problem?.suggestion ? { suggestion: problem.suggestion } : {}),
    ...(version === undefined ? {} : { version }), ...(conflict ? { isConflict: true } : {}), ...(held_by ? { heldBy: held_by } : {}),
  };
}
