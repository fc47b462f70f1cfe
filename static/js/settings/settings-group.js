// The thresholds under one heading, folded away until they are wanted.

import { html, icon, setText, setSentence, show } from '../core/dom.js';
import { found } from './settings-layout.js';
import { SettingsRow } from './settings-row.js';
import { counted } from '../core/format.js';

export class SettingsGroup {
  /** Was it opened by a search? Then it closes with it. */
  #isOpenedBySearch = false;

  /**
   * @param {import('./settings-model.js').SettingsModel} model
   * @param {{heading: string, names: string[]}} group
   * @param {boolean} isOpen
   */
  constructor(model, { heading, names }, isOpen) {
    this.model = model;
    this.rows = names.flatMap((name) => {
      const field = model.body?.schema[name];
      return field ? [new SettingsRow(model, name, field)] : [];
    });
    this.count = html('span', { class: 'count' });
    this.element = /** @type {HTMLDetailsElement} */ (html('details', { class: 'group', open: isOpen },
      html('summary', {}, html('span', { class: 'h' }, heading), this.count, icon('next')), ...this.rows.map((row) => row.element)));
    setText(this.count, counted(this.rows.length, 'limit'));
    this.element.addEventListener('toggle', () => this.draw()); // not empty until the next state comes
  }

  /** Shows what a search matches; returns how many there are. @param {string} query */
  filter(query) {
    const hits = this.rows.filter((row) => found(query, row.texts));
    for (const row of this.rows) show(row.element, hits.includes(row));
    show(this.element, hits.length > 0);
    if (query && hits.length && !this.element.open) {
      this.element.open = true;
      this.#isOpenedBySearch = true;
    } else if (!query && this.#isOpenedBySearch) {
      this.element.open = false;
      this.#isOpenedBySearch = false;
    }
    return hits.length;
  }

  draw() {
    const own = this.rows.filter((row) => this.model.body?.changed.includes(row.name)).length;
    setSentence(this.count, own ? `${own} of ${this.rows.length} changed` : String(this.rows.length));
    if (this.element.open) for (const row of this.rows) row.draw();
  }

  stop() {
    for (const row of this.rows) row.stop();
  }
}
