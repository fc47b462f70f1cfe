// The list of people in Settings: add, rename, remove; the role of each; and after how long a duty ends by itself.

import { AddPerson } from './add-person.js';
import { lastWords } from './people-layout.js';
import { styled } from '../core/style-sheet.js';
import { request, sentenceOf } from './request.js';
import { html, icon, listen, setText, setSentence } from '../core/dom.js';
import { counted } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').PeopleList} PeopleShown
 * @typedef {import('../core/protocol-types.js').PersonRow} PersonRow
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/**
 * @param {HTMLElement} place
 * @param {HTMLDetailsElement} group in which it is: while folded it requests nothing
 * @param {import('../core/store.js').Store} store
 * @param {Say} say
 * @param {(text: string) => void} head shows the state in the group's summary
 */
export async function mount(place, group, store, say, head) {
  await styled('people');
  if (store.isViewer) {
    place.replaceChildren(html('p', { class: 'state' }, 'This device is paired as a viewer: an operator sees and changes the list of people.'));
    return;
  }
  new PeopleGroup(place, group, store, say, head);
}

class PeopleGroup {
  #drawn = '';

  /** @param {HTMLElement} place @param {HTMLDetailsElement} group @param {import('../core/store.js').Store} store @param {Say} say @param {(text: string) => void} head */
  constructor(place, group, store, say, head) {
    this.group = group;
    this.say = say;
    this.head = head;
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.list = html('ul', { class: 'people-list', 'aria-label': 'People' });
    this.name = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: 30, autocomplete: 'off', autocapitalize: 'words', spellcheck: 'false', 'aria-label': 'Name or initials of one more person', placeholder: 'Name or initials' }));
    const add = html('button', { type: 'submit', class: 'key wide', 'data-f': 'person-add' }, icon('plus'), 'Add');
    const adding = new AddPerson(add);
    const form = html('form', { class: 'keys' }, html('div', { class: 'field' }, this.name), add);
    this.hours = /** @type {HTMLInputElement} */ (html('input', { type: 'number', min: 1, max: 24, step: 1, inputmode: 'numeric', 'aria-label': 'A duty ends by itself after so many hours' }));
    const hours = html('label', { class: 'hours' }, html('span', {}, 'A duty ends by itself after, hours'), html('span', { class: 'field' }, this.hours));
    place.replaceChildren(this.bad, this.list, form, hours);
    listen(form, 'submit', (event) => {
      event.preventDefault();
      void this.#send(() => adding.add({ name: this.name.value }, event), 'Not added').then((isDone) => { if (isDone) this.name.value = ''; });
    });
    listen(this.hours, 'change', () => void this.#send(() => request('/api/people', { method: 'PATCH', body: { ends_after_h: Number(this.hours.value) } }), 'Not changed'));
    listen(group, 'toggle', () => group.open && void this.#ask());
    store.on('duty', () => group.open && void this.#ask());
    void this.#ask();
  }

  async #ask() {
    try {
      this.#take(await request('/api/people'));
      setText(this.bad, '');
    } catch (error) {
      setSentence(this.bad, sentenceOf(error));
    }
  }

  /** @param {PeopleShown} shown */
  #take(shown) {
    this.head(shown.people.length ? counted(shown.people.length, 'person', 'people') : 'nobody');
    if (document.activeElement !== this.hours) this.hours.value = String(shown.ends_after_h);
    const key = JSON.stringify(shown.people);
    if (key === this.#drawn || this.list.contains(document.activeElement)) return; // what is typed is not taken away
    this.#drawn = key;
    this.list.replaceChildren(...shown.people.map((row) => this.#row(row, shown.roles)));
  }

  /** @param {PersonRow} row @param {PeopleShown['roles']} roles */
  #row(row, roles) {
    const path = `/api/people/${encodeURIComponent(row.id)}`;
    const name = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: 30, autocomplete: 'off', spellcheck: 'false', 'aria-label': `Name of ${row.name}` }));
    name.value = row.name;
    const role = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': `Role of ${row.name}` }, ...roles.map((one) => html('option', { value: one.role }, one.title))));
    role.value = row.role;
    const remove = html('button', { type: 'button', class: 'key', 'aria-label': `Remove ${row.name}`, 'data-f': 'person-remove' }, icon('trash'));
    const about = html('span', { class: 'm' });
    setSentence(about, lastWords(row, Date.now()));
    name.addEventListener('change', () => void this.#send(() => request(path, { method: 'PATCH', body: { name: name.value } }), 'Not renamed'));
    role.addEventListener('change', () => void this.#send(() => request(path, { method: 'PATCH', body: { role: role.value } }), 'Not changed'));
    remove.addEventListener('click', () => void this.#send(() => request(path, { method: 'DELETE' }), 'Not removed'));
    return html('li', { 'data-id': row.id }, html('span', { class: 'field' }, name), html('span', { class: 'field' }, role), remove, about);
  }

  /** @param {() => Promise<PeopleShown>} doing @param {string} title of a refusal */
  async #send(doing, title) {
    let isDone = true;
    try {
      const shown = await doing();
      if (document.activeElement instanceof HTMLElement && this.list.contains(document.activeElement)) document.activeElement.blur();
      this.#take(shown);
      setText(this.bad, '');
    } catch (error) {
      isDone = false;
      this.say(sentenceOf(error), title);
      this.#drawn = '';
      await this.#ask();
    }
    return isDone;
  }
}
