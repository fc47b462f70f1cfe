// The steps of a slow-down order on the page, also announced to screen readers.

import { field, html, icon, need, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { orderWords, stepsOf } from './slow-layout.js';

/** @typedef {import('../core/protocol-types.js').SlowDownOrder} SlowOrder */

const STEPS = 4;
const MARKS = { ok: 'ok', wait: 'unknown', crit: 'crit' };
const RELEASED = 'The car is released.';

export class OrderSteps {
  #announced = '';

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.store = store;
    this.steps = field(root, 'order-steps');
    this.line = field(root, 'order-line');
    this.live = field(root, 'order-live');
    this.strip = field(root, 'strip');
    this.rows = Array.from({ length: STEPS }, () => ({ mark: icon('unknown', 's'), label: html('span', { class: 'lab' }), value: html('b') }))
      .map((row) => ({ ...row, item: html('li', {}, row.mark, row.label, row.value) }));
    store.on('switch', () => { this.#announced = ''; }); // the other car was not released
    need(this.steps, 'ol').append(...this.rows.map(({ item }) => item));
  }

  /** @param {SlowOrder | null} order */
  draw(order) {
    show(this.steps, order !== null);
    this.#announce(order);
    if (!order) return;
    stepsOf(order).forEach(({ label, value, mark }, i) => {
      const row = this.rows[i];
      if (!row) return;
      setAttribute(row.item, 'data-mark', mark);
      setIcon(row.mark, MARKS[mark]);
      setText(row.label, label);
      setSentence(row.value, value);
    });
    const line = orderWords(order, this.store.isSilent ? 0 : this.store.lag_s);
    setAttribute(this.steps, 'data-kind', line.kind || null);
    setAttribute(this.steps, 'data-said', order.confirmed === false && this.store.vehicles.length === 1 && this.strip.hasAttribute('data-unconfirmed')); // the strip says the same
    setSentence(this.line, this.store.vehicles.length > 1 ? `${this.store.vehicle}: ${line.text}` : line.text);
  }

  /** Announces each change of the order once. @param {SlowOrder | null} order */
  #announce(order) {
    const text = !order ? (this.#announced ? RELEASED : '')
      : order.stands ? orderWords(order, 0).text : order.confirmed === null ? 'Slow-down ordered.' : order.confirmed ? 'The car slows: confirmed.' : orderWords(order, 0).text;
    if (text === this.#announced) return;
    setText(this.live, text);
    this.#announced = text;
  }
}
