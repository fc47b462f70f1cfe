// The slides that order a slow-down: the one in the action bar and those in the sheets of alarms.

import { field, setSentence, show } from '../core/dom.js';
import { SlideKey } from './slide.js';
import { orderOf, seenOf, slideOf } from './slow-layout.js';

/** Time limit of an answer [ms]. Later it is not known whether the car is slowed, and the frames show it. */
export const ANSWER_MS = 2000;
const SENDING = { kind: /** @type {const} */ ('go'), title: 'Sending', why: 'the order', label: 'The order to slow down is being sent' };

/** @typedef {(sentence: string, title: string) => void} Explain */

export class SlowSlides {
  /** Until when an order of this page may be unanswered [ms]. */
  #sending_ms = -Infinity;

  /**
   * @param {import('../core/store.js').Store} store
   * @param {{say: import('../control/control.js').Say, openSheet: () => void, draw: () => void}} page
   */
  constructor(store, { say, openSheet, draw }) {
    this.store = store;
    this.redraw = draw;
    this.slides = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll('.slide[data-f="slow"]'))].map((slide) => {
      const sheet = slide.closest('dialog');
      const message = sheet && field(sheet, 'slow-message');
      /** Shows a sentence where it is readable: an alarm's sheet covers the notices. @type {Explain} */
      const explain = (sentence, title) => {
        if (!message || !sheet?.open) return say(sentence, title);
        show(message, true);
        setSentence(message, `${title}: ${sentence}`);
      };
      if (message) sheet.addEventListener('close', () => show(message, false));
      return new SlideKey(slide, {
        press: () => (sheet ? explain(this.#whyOff(), 'Not slowed') : openSheet()),
        order: (at_ms, vehicle) => void this.#order(at_ms, vehicle, explain),
      });
    });
    this.stops = [...this.slides.map((slide) => () => slide.stop()), store.on('switch', () => { this.#sending_ms = -Infinity; })];
  }

  /** @param {import('./slow-layout.js').Seen} seen */
  draw(seen) {
    const isSending = this.store.now() < this.#sending_ms && !orderOf(seen.now);
    for (const key of this.slides) key.draw({ ...(isSending ? SENDING : slideOf(seen, key.slide.closest('dialog') !== null)), vehicle: this.store.vehicle });
  }

  /** The reason that an alarm's sheet shows when the slow-down cannot be used. */
  #whyOff() {
    const seen = seenOf(this.store);
    const { state, why } = seen.now ?? {};
    const because = seen.isSilent ? 'the server does not answer.'
      : seen.isViewer ? 'viewers cannot use it.'
        : state === 'not_armed' ? 'the slow-down is not armed; acknowledge the alarm, then arm it.'
          : why ?? 'it is not available.';
    return `${because} Use the physical stop.`;
  }

  /** @param {number} at_ms when the slide was released @param {string} vehicle the car whose name stood on it @param {Explain} explain */
  async #order(at_ms, vehicle, explain) {
    const { store } = this;
    if (!store.frame) return;
    const ago_s = (performance.now() - at_ms) / 1000;
    this.#sending_ms = store.now() + ANSWER_MS;
    const reply = store.ask('slow_down', {
      vehicle: vehicle || null,
      pressed_ago_s: ago_s >= 0 && ago_s < 60 ? ago_s : 0, // old browsers count the time of events from another moment
    }, ANSWER_MS);
    this.redraw();
    const answer = await reply;
    if (!answer.ok) {
      this.#sending_ms = -Infinity;
      const [what, ofOther] = answer.outcome === 'unknown' ? ['Not known whether slowed', `${vehicle}: Not known whether slowed`] : ['NOT slowed', `${vehicle} NOT slowed`];
      explain(`${answer.reason ?? 'Refused.'} Use the physical stop.`, vehicle && vehicle !== store.vehicle ? ofOther : what);
    }
    this.redraw();
  }
}
