// The vehicles in reach of the server, on the connect screen: requested while it is open, and listed.

import { bare, foundIn } from './connect-layout.js';
import { html, icon } from '../core/dom.js';

const REQUEST_EVERY_MS = 5000;

export class FoundVehicles {
  /** @type {import('./connect-layout.js').Found[] | null} */
  #found = null;
  #requested_ms = -Infinity;
  #drawn = '';

  /** @param {HTMLElement} list @param {() => string} chosen the address in the field */
  constructor(list, chosen) {
    this.list = list;
    this.chosen = chosen;
  }

  /** The next draw of the screen requests the list again. */
  forget() {
    this.#requested_ms = -Infinity;
  }

  /** Requests the list when it is due. @param {number} now_ms */
  async refresh(now_ms) {
    if (now_ms - this.#requested_ms <= REQUEST_EVERY_MS) return;
    this.#requested_ms = now_ms;
    try {
      const answer = await fetch('/api/vehicles', { cache: 'no-store' });
      this.#found = answer.ok ? foundIn(await answer.json()) : null;
    } catch {
      this.#found = null;
    }
    this.draw();
  }

  draw() {
    const here = this.chosen();
    const key = JSON.stringify([this.#found, here]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    if (!this.#found?.length) {
      const none = this.#found ? 'None found. Enter the address of the car’s rosbridge or Foxglove server.' : 'The server sent no list.';
      this.list.replaceChildren(html('li', { class: 'none' }, html('span', { class: 'm' }, none)));
      return;
    }
    this.list.replaceChildren(...this.#found.map((one) => {
      const address = bare(one.address ?? '');
      const row = html('button', { type: 'button', 'data-address': address }, icon('car'), html('span', { class: 't' }, one.name),
        html('span', { class: 'm' }, html('span', { class: 'n' }, address), one.phase && one.phase !== 'idle' ? ` · ${one.phase}` : ''));
      if (address === here) row.append(html('span', { class: 'r' }, icon('ok')));
      return html('li', {}, row);
    }));
  }
}
