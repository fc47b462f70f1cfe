// What is recorded now, above the list: its length and size, or why nothing is recorded; it is begun and ended by hand.

import { liveOf } from './files-layout.js';
import { record } from '../shell/record-key.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';

export class FilesLive {
  /**
   * @param {import('../core/store.js').Store} store
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(store, say) {
    this.store = store;
    this.name = html('div', { class: 't' });
    this.mark = html('div', { class: 'm' });
    this.facts = [html('span'), html('span'), html('span')];
    this.missing = html('div', { class: 'm', 'data-f': 'files-missing' });
    this.key = html('button', { type: 'button', class: 'key', 'data-f': 'files-record' });
    this.dot = html('span', { class: 'thumb none' }, icon('rec', 'l'));
    this.row = html('div', { class: 'file', 'data-live': '', hidden: true }, this.dot, html('div', { class: 'tx' }, this.name, this.mark, html('div', { class: 'm facts-line' }, ...this.facts), this.missing), this.key);
    this.element = html('section', { 'aria-label': 'The recorder' }, this.row);
    this.stop = listen(this.key, 'click', () => record(this.key.dataset['on'] === 'true', store, say));
  }

  /** @param {boolean} isWanted not among what was searched for, and not in the trash */
  draw(isWanted) {
    const { store } = this;
    const frame = store.heeded; // that of now, whatever is replayed
    const phase = frame?.session.phase;
    const live = isWanted ? liveOf(/** @type {import('./files-layout.js').Recorder | undefined} */ (frame?.recording), { vehicle: frame?.vehicle ?? null, isMonitoring: phase === 'monitoring' || phase === 'lost', isSilent: store.isSilent }) : null;
    show(this.row, live !== null);
    if (!live) return;
    if (store.replaying) live.order = null; // its key is with the live car
    setText(this.name, live.name);
    setSentence(this.mark, live.mark);
    [live.length, live.size, live.lost].forEach((text, i) => setSentence(/** @type {HTMLElement} */ (this.facts[i]), text));
    setSentence(this.missing, live.missing);
    show(this.missing, live.missing !== '');
    setAttribute(this.row, 'data-on', live.isOn);
    setAttribute(this.row, 'data-bad', live.isBad);
    show(this.key, live.order !== null);
    setAttribute(this.key, 'data-on', String(live.order));
    setText(this.key, live.order ? 'Record' : 'End');
    setAttribute(this.key, 'aria-label', live.order ? 'Record' : 'End the recording');
  }
}
