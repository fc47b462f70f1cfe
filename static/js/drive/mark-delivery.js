// Brings the marks of this phone to the server, oldest first, until it has acknowledged each. Voices and photos come after all marks,
// on a way of their own, so that none that takes long or cannot be taken keeps a mark waiting.

import { commandOf, markedAt, partsOf, waitingOf } from './mark-model.js';

/** After a step without an answer the next is tried so much later [ms], and at most so much. */
const LEAST_MS = 500;
const MOST_MS = 8000;
/** What the server refused is offered again so often: it may have been updated, or have room again [ms]. */
const REFUSED_MS = 30_000;
const COMMAND_MS = 4000;
const UPLOAD_MS = 60_000;
/** The server's answer for a mark that it does not have. */
const UNKNOWN = 'There is no such mark.';

/**
 * @typedef {import('./mark-model.js').Mark} Mark
 * @typedef {import('./mark-model.js').Step} Step
 * @typedef {{ok: boolean, isLost: boolean, reason: string}} Delivered isLost: no answer, or none that counts: try again
 * @typedef {object} Server
 * @property {() => boolean} isThere
 * @property {() => string} vehicle
 * @property {(fields: {mark: string, vehicle: string, at_ms: number, age_ms: number, category: string, words: string}, within_ms: number) => Promise<Delivered>} mark
 * @property {(id: string, vehicle: string, within_ms: number) => Promise<Delivered>} remove
 * @property {(id: string, vehicle: string, part: 'voice' | 'photo', blob: Blob, type: string, within_ms: number) => Promise<Delivered>} upload
 * @typedef {object} Marks
 * @property {() => Iterable<Mark>} all
 * @property {(id: string) => Promise<Mark | null>} read as it is now
 * @property {(id: string, change: (mark: Mark) => Mark | null) => Promise<void>} change null drops it
 * @property {(what: string, act: () => Promise<void>) => Promise<void>} alone acts while no other page of this browser does the same
 * @property {(reason: string) => void} onTakenBack the server answered to a removal; reason: why it refused, '' where it did not
 * @typedef {{mark: Mark, step: Step}} Work
 */

/** One way to the server: one step at a time, ever more seldom while no answer comes. */
class Way {
  /** @param {string} name */
  constructor(name) {
    this.name = name;
  }

  isBusy = false;
  due_ms = 0;
  wait_ms = LEAST_MS;
  /** When each step that was refused is offered again. @type {Map<string, number>} */
  refused = new Map();
  /** How often a step found no answer: those that did go first. @type {Map<string, number>} */
  lost = new Map();

  /** What is to be done now, those without an answer last. @param {Work[]} works @param {number} now_ms */
  next(works, now_ms) {
    const due = works.filter((work) => now_ms >= (this.refused.get(nameOf(work)) ?? -Infinity));
    const losses = (/** @type {Work} */ work) => this.lost.get(nameOf(work)) ?? 0;
    return due.sort((a, b) => losses(a) - losses(b))[0] ?? null;
  }

  /** @param {number} now_ms */
  rest(now_ms) {
    this.due_ms = now_ms + this.wait_ms;
    this.wait_ms = Math.min(MOST_MS, 2 * this.wait_ms);
  }

  hurry() {
    this.due_ms = 0;
    this.wait_ms = LEAST_MS;
  }
}

export class Delivery {
  #commands = new Way('commands');
  #parts = new Way('parts');

  /** @param {Marks} marks @param {Server} server @param {() => number} now monotonic time [ms] */
  constructor(marks, server, now) {
    this.marks = marks;
    this.server = server;
    this.now = now;
  }

  /** Something is to be delivered now, or the server is back. */
  hurry() {
    this.#commands.hurry();
    this.#parts.hurry();
    return this.look();
  }

  /** Time passes: deliver what waits. Resolves once nothing can be done for now. */
  async look() {
    await this.#go(this.#commands, () => this.#nextCommand());
    await this.#go(this.#parts, () => (this.#nextCommand() ? null : this.#nextPart()));
  }

  /** @param {Way} way @param {() => Work | null} next */
  async #go(way, next) {
    if (way.isBusy || this.now() < way.due_ms || !next()) return;
    way.isBusy = true;
    try {
      await this.marks.alone(way.name, async () => {
        for (let work = next(); work !== null; work = next()) {
          if (await this.#step(way, work)) way.wait_ms = LEAST_MS;
          else return way.rest(this.now());
        }
      });
    } finally {
      way.isBusy = false;
    }
  }

  #nextCommand() {
    return this.#next(this.#commands, (mark) => [commandOf(mark)].filter((step) => step !== null));
  }

  #nextPart() {
    return this.#next(this.#parts, partsOf);
  }

  /** @param {Way} way @param {(mark: Mark) => Step[]} stepsOf @returns {Work | null} */
  #next(way, stepsOf) {
    if (!this.server.isThere()) return null;
    const waiting = waitingOf(this.marks.all(), this.server.vehicle());
    return way.next(waiting.flatMap((mark) => stepsOf(mark).map((step) => ({ mark, step }))), this.now());
  }

  /** One step of one mark. @param {Way} way @param {Work} work @returns {Promise<boolean>} false: the server did not answer */
  async #step(way, { mark: { id }, step }) {
    if (step === 'drop') {
      await this.marks.change(id, () => null);
      return true;
    }
    if (!isPart(step)) await this.marks.change(id, (now) => (now.isSent ? now : { ...now, isSent: true }));
    const mark = await this.marks.read(id);
    // Meanwhile the server may have gone, another car may be shown, or the mark be another.
    if (!mark || !this.server.isThere() || this.server.vehicle() !== mark.vehicle || !stepsOf(mark).includes(step)) return true;
    const { version } = mark;
    const made = isPart(step) ? mark[step]?.made : undefined;
    const answer = await this.#send(step, mark);
    const name = nameOf({ mark, step });
    if (answer.isLost) {
      way.lost.set(name, (way.lost.get(name) ?? 0) + 1);
      return false;
    }
    way.lost.delete(name);
    const isUnknown = step === 'remove' && answer.reason === UNKNOWN; // so it is gone already
    if (answer.ok || isUnknown) {
      way.refused.delete(name);
      await this.marks.change(id, (now) => settled(now, step, version, made));
    } else {
      way.refused.set(name, this.now() + REFUSED_MS);
      await this.marks.change(id, (now) => (step === 'remove' ? notRemoved(now, answer.reason) : { ...now, refused: answer.reason }));
    }
    if (step === 'remove') this.marks.onTakenBack(isUnknown ? '' : answer.reason);
    return true;
  }

  /** @param {Exclude<Step, 'drop'>} step @param {Mark} mark @returns {Promise<Delivered>} */
  #send(step, mark) {
    const { id, vehicle, category, words } = mark;
    const age_ms = Date.now() - mark.wall_ms - mark.shift_s * 1000; // the server's clock may have been set since
    if (step === 'remove') return this.server.remove(id, vehicle, COMMAND_MS);
    if (step === 'mark' || step === 'change') return this.server.mark({ mark: id, vehicle, at_ms: markedAt(mark), age_ms, category: category ?? '', words }, COMMAND_MS);
    const part = /** @type {import('./mark-model.js').Part} */ (mark[step]);
    return this.server.upload(id, vehicle, step, /** @type {Blob} */ (part.blob), part.type, UPLOAD_MS);
  }
}

/** @param {Work} work */
function nameOf({ mark, step }) {
  return `${step} ${mark.id}`;
}

/** @param {Step} step @returns {step is 'voice' | 'photo'} */
function isPart(step) {
  return step === 'voice' || step === 'photo';
}

/** @param {Mark} mark @returns {Step[]} */
function stepsOf(mark) {
  const command = commandOf(mark);
  return command ? [command] : partsOf(mark);
}

/**
 * A mark once the server acknowledged a step of it; null: it is gone.
 * @param {Mark} mark as it is now
 * @param {Step} step
 * @param {number} version that was sent
 * @param {string | undefined} made what was sent, as against what replaced it
 * @returns {Mark | null}
 */
function settled(mark, step, version, made) {
  if (step === 'remove') return null;
  if (!isPart(step)) return { ...mark, refused: '', stored: Math.max(mark.stored, version) };
  const part = mark[step];
  if (!part || part.made !== made) return mark; // another one was taken meanwhile: it is still to be delivered
  return { ...mark, refused: '', [step]: { ...part, blob: null, isStored: true } };
}

/** @param {Mark} mark @param {string} reason @returns {Mark} */
function notRemoved(mark, reason) {
  return { ...mark, isRemoved: false, refused: reason };
}
