// What a press on the Mark key does: a tap marks, a held press adds voice.

import { cutWords, LONGEST_MS, refusalWords, Voice } from './voice.js';
import { listen, setAttribute } from '../core/dom.js';
import { cameAt } from '../core/meant.js';
import { Press } from './press.js';
import { quietly } from './marks.js';

const LOOKS_EVERY_MS = 50;
/** A voice of less is a slip of the finger [ms]. */
const LEAST_VOICE_MS = 200;

/**
 * @typedef {import('./voice.js').Ending} Ending
 * @typedef {{id: string, voice: Voice, isPulled: boolean, isRefused: boolean}} Spoken isPulled: without its voice; isRefused: the microphone was
 */

export class MarkKey {
  #press = new Press();
  /** @type {Spoken | null} */
  #speaking = null;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #clock;

  /**
   * @param {HTMLElement} key
   * @param {import('./marks.js').Marks} marks
   * @param {import('./marks.js').Say} say
   * @param {import('./fresh-panel.js').FreshPanel} fresh
   */
  constructor(key, marks, say, fresh) {
    this.key = key;
    this.marks = marks;
    this.say = say;
    this.fresh = fresh;
    const done = (/** @type {import('./press.js').Done} */ what) => quietly(() => this.#done(what));
    this.stops = [
      listen(key, 'pointerdown', (event) => this.#down(event)),
      listen(key, 'pointermove', (event) => done(this.#press.move(event.clientX))),
      listen(key, 'pointerup', (event) => this.#up(event)),
      listen(key, 'pointercancel', () => done(this.#press.cancel())),
      listen(key, 'lostpointercapture', () => done(this.#press.cancel())),
      listen(key, 'contextmenu', (event) => event.preventDefault()), // a long press is ours
      listen(key, 'click', (event) => event.detail === 0 && done(this.#press.click(cameAt(event)))),
      listen(document, 'visibilitychange', () => document.hidden && this.#end('hidden')),
      listen(window, 'pagehide', () => this.#end('page')),
    ];
  }

  stop() {
    clearInterval(this.#clock);
    this.#end('page');
    for (const stop of this.stops) stop();
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button !== 0 || this.#press.isDown || this.key.getAttribute('aria-disabled') === 'true') return;
    this.key.setPointerCapture(event.pointerId);
    this.#press.down(cameAt(event), event.clientX);
    clearInterval(this.#clock);
    this.#clock = setInterval(() => quietly(() => this.#look()), LOOKS_EVERY_MS);
  }

  /** @param {PointerEvent} event */
  #up(event) {
    const ago_ms = this.#press.for_ms(performance.now());
    quietly(() => this.#done(this.#press.up(cameAt(event)), ago_ms));
  }

  #look() {
    const now_ms = performance.now();
    this.#done(this.#press.look(now_ms), this.#press.for_ms(now_ms));
    if (this.#speaking && this.#speaking.voice.length_ms >= LONGEST_MS) this.#end('full');
    if (!this.#press.isDown && !this.#speaking) clearInterval(this.#clock);
  }

  /** @param {import('./press.js').Done} what @param {number} [ago_ms] when the press began */
  #done(what, ago_ms = 0) {
    if (what === 'tap') this.fresh.show(this.marks.place(ago_ms));
    else if (what === 'hold') this.#speak(ago_ms);
    else if (what === 'keep') this.#end('let go');
    else if (what === 'pull' && this.#speaking) {
      this.#speaking.isPulled = true;
      this.#end('let go');
    }
  }

  /** The mark stands at once, whatever becomes of the microphone. @param {number} ago_ms */
  #speak(ago_ms) {
    const { id } = this.marks.place(ago_ms);
    const speaking = { id, voice: new Voice(() => void this.#keep(speaking, false)), isPulled: false, isRefused: false };
    this.#speaking = speaking;
    setAttribute(this.key, 'data-held', true);
    const mark = this.marks.get(id);
    if (mark) this.fresh.listen(mark, speaking.voice);
    navigator.vibrate?.(30);
    speaking.voice.begin().catch((error) => {
      speaking.isRefused = true;
      this.say(`${refusalWords(error)} The moment is marked all the same.`, 'No voice');
      speaking.voice.end('let go');
    });
    void speaking.voice.ended.then((ending) => this.#ended(speaking, ending));
  }

  /** @param {Ending} ending */
  #end(ending) {
    const speaking = this.#speaking;
    if (!speaking) return;
    speaking.voice.end(ending);
    setAttribute(this.key, 'data-held', null);
  }

  /** @param {Spoken} speaking @param {Ending} ending */
  async #ended(speaking, ending) {
    const isLast = this.#speaking === speaking; // while it ended another may have begun
    if (isLast) {
      this.#speaking = null;
      setAttribute(this.key, 'data-held', null);
    }
    const { voice, id, isPulled, isRefused } = speaking;
    const isKept = !isPulled && voice.blob !== null && voice.length_ms >= LEAST_VOICE_MS;
    if (isKept) await this.#keep(speaking, true, cutWords(ending, voice.length_ms / 1000));
    else {
      await this.marks.change(id, (mark) => ({ ...mark, voice: null }));
      if (!isPulled && !isRefused) this.say('The microphone was not ready yet: hold the key longer, once it may be used, to add voice. The moment is marked.', 'No voice');
    }
    if (isLast && !this.#speaking) this.fresh.voiceEnded();
  }

  /**
   * Keeps what was spoken so far: the page may be killed at any time.
   * @param {Spoken} speaking
   * @param {boolean} isOver
   * @param {string} [note]
   */
  #keep({ id, voice, isPulled }, isOver, note = '') {
    const { blob, type, length_ms } = voice;
    if (!blob || isPulled || (!isOver && this.#speaking?.id !== id)) return;
    return this.marks.attach(id, 'voice', { blob, type, bytes: blob.size, length_s: length_ms / 1000, note, isOpen: !isOver, isStored: false });
  }
}
