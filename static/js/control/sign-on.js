// "Who is on duty?": the list of people. The first tap chooses, with the role of the last time; the second signs on.

import { AddPerson } from './add-person.js';
import { initialsOf } from './duty-layout.js';
import { lastWords } from './people-layout.js';
import { styled } from '../core/style-sheet.js';
import { request, sentenceOf } from './request.js';
import { html, icon, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { addSheet, closeSheet, mustWait, openSheet } from '../shell/sheet.js';
import { timeOfDay } from '../core/format.js';
import { openScreen } from '../core/open-screen.js';
import { stateWords } from '../drive/departure-layout.js';

/**
 * @typedef {import('../core/protocol-types.js').PeopleList} PeopleList
 * @typedef {import('../core/protocol-types.js').PersonRow} PersonRow
 * @typedef {import('./duty.js').DutyStore & {name?: string, frame?: {departure?: import('../core/protocol-types.js').DepartureState} | null}} DutyStore
 * @typedef {PersonRow['role']} Role
 */

/** @param {DutyStore} store @param {import('./duty.js').Say} say @param {() => boolean} [mayOpen] called once it is loaded @returns {Promise<boolean>} whether it opened */
export async function openSignOn(store, say, mayOpen = () => true) {
  await styled('people');
  if (mustWait() || !mayOpen() || document.querySelector('#sheet-duty[open]')) return false;
  new SignOn(store, say);
  return true;
}

/** Somebody who is not in the list yet. */
const NEW = ' new';

class SignOn {
  /** @type {PeopleList | null} */
  #list = null;
  #chosen = '';
  /** @type {Role} */
  #role = 'operator';
  #isBusy = false;

  /** @param {DutyStore} store @param {import('./duty.js').Say} say */
  constructor(store, say) {
    this.store = store;
    this.say = say;
    this.title = html('h2', { id: 'duty-title' }, 'Who is on duty?');
    this.text = html('p', { class: 'sub', id: 'duty-words' });
    this.rows = html('ul', { class: 'people-rows', 'aria-label': 'People' });
    this.name = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: 30, autocomplete: 'off', autocapitalize: 'words', spellcheck: 'false', enterkeyhint: 'done', 'aria-label': 'Name or initials', placeholder: 'Name or initials' }));
    this.field = html('div', { class: 'field', hidden: true }, this.name);
    this.roles = html('div', { class: 'seg roles', role: 'group', 'aria-label': 'Role' });
    this.role = html('div', { class: 'role' }, html('p', { class: 'lab' }, 'Role'), this.roles);
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.keyTitle = html('b');
    this.keyText = html('span');
    this.key = html('button', { type: 'button', class: 'main sign', 'data-f': 'sign-on' }, this.keyTitle, this.keyText);
    this.off = html('button', { type: 'button', class: 'key wide', 'data-f': 'sign-off' }, 'Sign off');
    this.departure = html('button', { type: 'button', class: 'key wide', 'data-f': 'duty-departure', hidden: true });
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close', 'data-f': 'no' }, icon('close'));
    const keys = html('div', { class: 'duty-keys' }, this.bad, this.key, this.departure, this.off);
    this.adding = new AddPerson(keys);
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed duty-sheet', id: 'sheet-duty', 'aria-labelledby': 'duty-title', 'aria-describedby': 'duty-words' },
      html('div', { class: 'duty-head' }, this.title, close),
      html('div', { class: 'duty-body', tabindex: '0', role: 'group', 'aria-label': 'List of people' }, this.text, this.rows, this.field),
      this.role, keys));
    const stops = [store.on('duty', () => void this.#ask()), addSheet(this.sheet)];
    this.sheet.addEventListener('close', () => stops.forEach((stop) => stop()), { once: true });
    this.key.addEventListener('click', (event) => void this.#sign(event));
    this.off.addEventListener('click', () => void this.#signOff());
    this.departure.addEventListener('click', () => {
      closeSheet(this.sheet);
      openScreen('departure');
    });
    this.name.addEventListener('input', () => this.#draw());
    this.name.addEventListener('keydown', (event) => event.key === 'Enter' && void this.#sign(event));
    this.#draw();
    openSheet(this.sheet);
    this.title.tabIndex = -1;
    this.title.focus();
    void this.#ask();
  }

  get #me() {
    return this.#list?.me ?? null;
  }

  async #ask() {
    try {
      this.#take(await request('/api/people'));
    } catch (error) {
      setSentence(this.bad, sentenceOf(error));
    }
  }

  /** @param {PeopleList} list */
  #take(list) {
    this.#list = list;
    if (!list.people.length) this.#chosen = NEW;
    else if (this.#chosen !== NEW && !list.people.some(({ id }) => id === this.#chosen)) this.#chosen = '';
    this.#drawRows();
    this.#draw();
  }

  #drawRows() {
    const { people, roles } = /** @type {PeopleList} */ (this.#list);
    const focused = document.activeElement instanceof HTMLElement && this.rows.contains(document.activeElement) ? document.activeElement.dataset['person'] : undefined;
    const titleOf = (/** @type {Role} */ role) => roles.find((one) => one.role === role)?.title ?? role;
    this.rows.replaceChildren(
      ...people.map((row) => this.#row(row.id, initialsOf(row.name), row.name, `${titleOf(row.duty?.role ?? row.role)} · ${lastWords(row, Date.now())}`)),
      this.#row(NEW, '+', 'Somebody else', 'name or initials, and role, once'),
    );
    if (focused) /** @type {HTMLElement | null} */ (this.rows.querySelector(`[data-person="${CSS.escape(focused)}"]`))?.focus({ preventScroll: true });
    this.roles.replaceChildren(...roles.map(({ role, title }) => {
      const key = html('button', { type: 'button', 'data-role-key': role }, title);
      key.addEventListener('click', () => {
        this.#role = role;
        this.#draw();
      });
      return key;
    }));
  }

  /** @param {string} id @param {string} disc @param {string} name @param {string} about */
  #row(id, disc, name, about) {
    const more = html('span', { class: 'm' });
    setSentence(more, about);
    const key = html('button', { type: 'button', 'data-person': id }, html('span', { class: 'disc', 'aria-hidden': 'true' }, id === NEW ? icon('plus') : disc), html('bdi', { class: 't' }, name), more, icon('ok'));
    key.addEventListener('click', () => this.#choose(id));
    return html('li', {}, key);
  }

  /** @param {string} id */
  #choose(id) {
    this.#chosen = id;
    const row = this.#list?.people.find((one) => one.id === id);
    if (row) this.#role = row.duty?.role ?? row.role;
    setText(this.bad, '');
    this.#draw();
    if (id === NEW) this.name.focus();
  }

  #draw() {
    const me = this.#me;
    const row = this.#list?.people.find((one) => one.id === this.#chosen);
    const isNew = this.#chosen === NEW;
    setText(this.title, me ? `${me.name} is on duty` : 'Who is on duty?');
    setSentence(this.text, me ? `As ${me.title} since ${timeOfDay(me.since_ms).slice(0, 5)}. Choose another person if this device passes to another person.` : 'The name goes with every order, acknowledgement and setting of this device.');
    for (const key of this.rows.querySelectorAll('[data-person]')) setAttribute(key, 'aria-pressed', String(key.getAttribute('data-person') === this.#chosen));
    for (const key of this.roles.children) setAttribute(key, 'aria-pressed', String(key.getAttribute('data-role-key') === this.#role));
    show(this.field, isNew);
    show(this.role, isNew || row !== undefined);
    show(this.off, me !== null);
    const check = this.store.frame?.departure; // none on the page of all cars
    show(this.departure, me !== null && check !== undefined);
    setText(this.departure, stateWords(check));
    const name = row?.name ?? this.name.value.trim();
    const isElsewhere = row?.duty && row.duty.person !== me?.person;
    const title = this.#list?.roles.find(({ role }) => role === this.#role)?.title ?? '';
    const isReady = Boolean(name) && !this.#isBusy && (row !== undefined || isNew);
    setText(this.keyTitle, !name || (!row && !isNew) ? 'Sign on' : isElsewhere ? `Move ${name} to this device` : `Sign on as ${name}`);
    setText(this.keyText, !isReady ? (this.#chosen ? '' : 'choose a person') : isElsewhere ? `${title} · ends at ${row?.duty?.device}` : title);
    setAttribute(this.key, 'aria-disabled', isReady ? null : 'true');
  }

  /** @param {Event} event */
  async #sign(event) {
    const row = this.#list?.people.find((one) => one.id === this.#chosen);
    const name = this.name.value.trim();
    if (this.#isBusy || (!row && !(this.#chosen === NEW && name))) return;
    await this.#send(async () => {
      let id = row?.id;
      if (!id) {
        /** @type {PeopleList} */
        const list = await this.adding.add({ name, role: this.#role }, event);
        id = list.added; // two devices may add people at once
        this.#chosen = id ?? '';
        this.#take(list);
      }
      await request('/api/duty', { method: 'POST', body: { person: id, role: this.#role, moves: Boolean(row?.duty), ...(this.store.name ? { device: this.store.name } : {}) } });
      closeSheet(this.sheet);
    });
  }

  async #signOff() {
    await this.#send(async () => {
      await request('/api/duty', { method: 'DELETE' });
      closeSheet(this.sheet);
    });
  }

  /** @param {() => Promise<void>} doing */
  async #send(doing) {
    this.#isBusy = true;
    setText(this.bad, '');
    this.#draw();
    try {
      await doing();
    } catch (error) {
      setSentence(this.bad, sentenceOf(error));
      await this.#ask();
    }
    this.#isBusy = false;
    this.#draw();
  }
}
