// The search of the Files tab: a text field, and a choice by time, vehicle and tag.

import { choiceOf } from './files-layout.js';
import { html, icon, listen, show } from '../core/dom.js';

const FEW = 5; // so many recordings are seen at one glance: no search is needed
const TYPING_MS = 200; // a pause in typing after which the search starts

export class FilesSearch {
  #options = '';
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #typing;

  /** @param {import('./files-model.js').FilesModel} model */
  constructor(model) {
    this.model = model;
    const text = /** @type {HTMLInputElement} */ (html('input', {
      type: 'search', placeholder: 'Search', 'aria-label': 'Search recordings', autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false', enterkeyhint: 'search', maxlength: 100,
    }));
    this.select = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': 'Which recordings' }));
    this.element = html('div', { class: 'files-find', hidden: true }, html('div', { class: 'field' }, icon('find'), text), this.select);
    this.stops = [
      listen(text, 'input', () => {
        clearTimeout(this.#typing);
        this.#typing = setTimeout(() => model.want({ text: text.value }), TYPING_MS);
      }),
      listen(this.select, 'change', () => model.want({ choice: choiceOf(this.select.value) })),
      () => clearTimeout(this.#typing),
    ];
  }

  draw() {
    const { listing, isTrash, isFiltered } = this.model;
    show(this.element, !isTrash && ((listing.all?.count ?? 0) > FEW || isFiltered));
    this.#drawOptions();
  }

  #drawOptions() {
    const { model, select } = this;
    const { vehicles = [], tags = [] } = model.listing;
    const key = JSON.stringify([vehicles, tags]);
    if (key === this.#options) return;
    this.#options = key;
    const was = select.value || 'all';
    const option = (/** @type {string} */ value, /** @type {string} */ label) => html('option', { value }, label);
    select.replaceChildren(option('all', 'All'), html('optgroup', { label: 'Time' }, option('days:1', 'Today'), option('days:7', 'Last 7 days'), option('days:30', 'Last 30 days')),
      ...(vehicles.length > 1 ? [html('optgroup', { label: 'Vehicle' }, ...vehicles.map((name) => option(`vehicle:${name}`, name)))] : []),
      ...(tags.length ? [html('optgroup', { label: 'Tag' }, ...tags.map((tag) => option(`tag:${tag}`, tag)))] : []));
    select.value = was;
    if (select.selectedIndex < 0) {
      select.value = 'all';
      if (model.choice.kind !== 'all') model.want({ choice: choiceOf('all') });
    }
  }
}
