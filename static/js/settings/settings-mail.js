// The group "E-mail" of the Settings tab: folded away, and its form fetched when it is opened.

import { html, icon, listen, setText, show } from '../core/dom.js';
import { found } from './settings-layout.js';

const NAMES = ['e-mail mail SMTP host port security STARTTLS TLS user password sender name allowed recipients domains size limit link certificate test outbox'];

export class SettingsMail {
  #isOpenedBySearch = false;
  /** @type {Promise<void> | null} */
  #loading = null;

  /** @param {(sentence: string, title?: string) => void} say */
  constructor(say) {
    this.say = say;
    this.state = html('span', { class: 'count' });
    this.place = html('div', {}, html('p', { class: 'state', role: 'status' }, 'Loading from the server…'));
    this.group = /** @type {HTMLDetailsElement} */ (html('details', { class: 'group', 'data-part': 'mail' },
      html('summary', {}, html('span', { class: 'h' }, 'E-mail'), this.state, icon('next')), this.place));
    this.element = html('section', { 'aria-label': 'E-mail' }, html('div', { class: 'sec' }, html('span', {}, 'Server'), html('span', {}, 'for all its vehicles')), this.group);
    this.stops = [listen(this.group, 'toggle', () => { if (this.group.open) this.#load(); })];
  }

  /** Shows it where a search asks for it; how many there are. @param {string} query */
  filter(query) {
    const isHit = found(query, NAMES);
    show(this.element, isHit);
    if (query && isHit && !this.group.open) {
      this.group.open = true;
      this.#isOpenedBySearch = true;
    } else if (!query && this.#isOpenedBySearch) {
      this.group.open = false;
      this.#isOpenedBySearch = false;
    }
    return Number(isHit);
  }

  stop() {
    for (const stop of this.stops) stop();
  }

  #load() {
    this.#loading ??= import('../mail/mail-settings.js').then(({ mount }) => mount(this.place, this.say, (words) => setText(this.state, words))).catch(() => {
      this.#loading = null;
      this.place.replaceChildren(html('p', { class: 'state', role: 'status' }, 'It could not be loaded: the server does not answer. Close this group and open it again.'));
    });
  }
}
