// The banner of a slow-down that starts automatically: over everything, with a key that vetoes it.

import { fixed } from '../core/format.js';
import { field, listen, need, setText, setSentence, show } from '../core/dom.js';
import { Meant } from '../core/meant.js';
import { countdownOf, nameOf } from './slow-layout.js';
import { ANSWER_MS } from './slow-slides.js';

export class Countdown {
  #from_s = 0;
  #meant;
  /** The trigger that was vetoed here; the frames confirm it a moment later. */
  #vetoed = '';

  /** @param {import('../core/store.js').Store} store */
  constructor(store) {
    this.store = store;
    this.banner = /** @type {HTMLDialogElement} */ (need(document, '#sheet-countdown'));
    this.veto = field(this.banner, 'veto');
    this.#meant = new Meant(this.banner);
    if (store.frame) this.draw();
    this.stops = [
      store.on('draw', () => this.draw()),
      listen(this.veto, 'click', (event) => this.#meant.by(event) && void this.#veto()),
      listen(this.banner, 'cancel', (event) => event.preventDefault()), // to leave it is no veto
    ];
  }

  draw() {
    const { banner, store } = this;
    const at = (/** @type {string} */ name) => field(banner, name);
    const now = store.frame?.replay ? store.frame.live?.decelerate : store.frame?.decelerate;
    const coming = store.isSilent ? null : countdownOf(now, store.lag_s);
    if (!coming) {
      this.#vetoed = '';
      if (banner.open) banner.close();
      return;
    }
    if (this.#vetoed === coming.trigger) return;
    if (!banner.open) {
      this.#from_s = coming.left_s;
      this.#meant.moved();
      setText(at('message'), '');
    }
    setSentence(at('title'), coming.title);
    setSentence(at('text'), coming.text);
    setText(at('left'), fixed(coming.left_s));
    at('bar').style.transform = `scaleX(${Math.min(1, coming.left_s / Math.max(0.1, this.#from_s)).toFixed(3)})`;
    this.veto.dataset['trigger'] = coming.trigger;
    this.veto.dataset['vehicle'] = store.vehicle;
    setText(at('car'), nameOf(store.vehicle) || 'the car');
    show(this.veto, !store.isViewer);
    show(at('viewer'), store.isViewer);
    this.#raise();
  }

  /** Puts the banner above every dialog that opened since, an alarm's sheet included. */
  #raise() {
    const { banner } = this;
    const others = document.querySelectorAll('dialog[open]:not(#sheet-countdown, [data-docked])');
    const key = [...others].map(({ id }) => id).join();
    if (banner.open && banner.dataset['over'] === key) return;
    banner.dataset['over'] = key;
    if (banner.open) banner.close();
    banner.showModal();
  }

  async #veto() {
    const trigger = this.veto.dataset['trigger'] ?? '';
    const answer = await this.store.ask('veto', { trigger, vehicle: this.veto.dataset['vehicle'] || null }, ANSWER_MS);
    if (answer.ok) {
      this.#vetoed = trigger;
      this.banner.close();
    } else setSentence(field(this.banner, 'message'), `${answer.outcome === 'unknown' ? 'Not known whether vetoed' : 'Not vetoed'}: ${answer.reason ?? 'refused.'}`);
  }
}
