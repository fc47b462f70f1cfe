// The group "Paired devices" of the Settings tab: folded away, and its list fetched when it is opened.

import { html, icon, listen, setText, show } from '../core/dom.js';
import { found } from './settings-layout.js';

const NAMES = ['paired devices phones pair another QR code PIN link role viewer operator remove revoke access who'];

export class SettingsDevices {
  #isOpenedBySearch = false;
  /** @type {Promise<void> | null} */
  #loading = null;

  /** @param {import('../core/store.js').Store} store @param {(sentence: string, title?: string) => void} say */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    this.isPairing = document.documentElement.dataset['access'] === 'paired';
    this.state = html('span', { class: 'count' });
    this.place = html('div', {}, html('p', { class: 'state', role: 'status' }, 'Loading from the server…'));
    this.element = /** @type {HTMLDetailsElement} */ (html('details', { class: 'group', 'data-part': 'devices', hidden: !this.isPairing },
      html('summary', {}, html('span', { class: 'h' }, 'Paired devices'), this.state, icon('next')), this.place));
    this.stops = [listen(this.element, 'toggle', () => { if (this.element.open) this.#load(); })];
  }

  /** Shows it where a search asks for it; how many there are. @param {string} query */
  filter(query) {
    const isHit = this.isPairing && found(query, NAMES);
    show(this.element, isHit);
    if (query && isHit && !this.element.open) {
      this.element.open = true;
      this.#isOpenedBySearch = true;
    } else if (!query && this.#isOpenedBySearch) {
      this.element.open = false;
      this.#isOpenedBySearch = false;
    }
    return Number(isHit);
  }

  stop() {
    for (const stop of this.stops) stop();
  }

  #load() {
    this.#loading ??= import('../pairing/devices.js').then(({ mount }) => mount(this.place, this.element, this.store, this.say, (words) => setText(this.state, words))).catch(() => {
      this.#loading = null;
      this.place.replaceChildren(html('p', { class: 'state', role: 'status' }, 'It could not be loaded: the server does not answer. Close this group and open it again.'));
    });
  }
}
