// The Settings tab: every threshold under its heading, the topics of the signals, the kind of car, the file of all of it.

import { departureGroup, devicesGroup, isOfAgent, mailGroup, peopleGroup } from './fetched-groups.js';
import { SettingsFileKeys } from './settings-file.js';
import { SettingsGroup } from './settings-group.js';
import { groupsOf } from './settings-layout.js';
import { settingsOf } from './settings-model.js';
import { SettingsTopics } from './settings-topics.js';
import { takeWanted } from '../core/open-screen.js';
import { openPreferences } from '../shell/preferences.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { counted, timeOfDay } from '../core/format.js';
import { styled } from '../core/style-sheet.js';

/** How many headings are open at first: those that are set in the field. */
const OPEN_AT_FIRST = 2;

/**
 * @param {HTMLElement} panel
 * @param {import('../shell/tab-contents.js').TabPage} page
 */
export function mount(panel, { store, say, isFront }) {
  panel.style.visibility = 'hidden';
  void styled('limits').then(() => panel.style.removeProperty('visibility'));
  const tab = new SettingsTab(panel, store, say, isFront);
  tab.begin();
  return { stop: () => tab.stop() };
}

class SettingsTab {
  /** @type {SettingsGroup[]} */
  #groups = [];
  #built = '';
  #query = '';

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   * @param {(sentence: string, title?: string) => void} say
   * @param {() => boolean} isShown
   */
  constructor(panel, store, say, isShown) {
    const model = settingsOf(store);
    this.panel = panel;
    this.store = store;
    this.say = say;
    this.isShown = isShown;
    this.model = model;
    this.topics = new SettingsTopics(store, model);
    this.file = new SettingsFileKeys(store, model, say);
    this.mail = mailGroup(say);
    this.people = peopleGroup(store, say);
    this.departure = departureGroup(store);
    this.devices = devicesGroup(store, say);
    this.parts = this.#build();
    const draw = () => this.draw();
    this.stops = [
      store.on('draw', draw),
      store.on('switch', () => {
        this.departure.forget(); // the list of another car is another one
        if (isOfAgent()) this.mail.forget();
      }),
      listen(this.parts.search, 'input', () => this.#filter()),
      listen(this.parts.undo, 'click', () => void this.#undo()),
      listen(this.parts.phone, 'click', openPreferences),
      listen(this.parts.close, 'click', () => { location.hash = '#home'; }),
      listen(window, 'catgraph-units', draw),
      listen(window, 'catgraph-settings', () => this.#searchWanted()),
      store.on('log', (events) => this.#announce(events)),
    ];
  }

  #build() {
    const search = /** @type {HTMLInputElement} */ (html('input', {
      type: 'search', placeholder: 'Search', 'aria-label': 'Search settings', autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false', enterkeyhint: 'search', maxlength: 60,
    }));
    const undo = html('button', { type: 'button', class: 'key wide undo', disabled: true }, icon('replay'), html('span', {}, 'Undo'));
    const state = html('p', { class: 'state', role: 'status' });
    const groups = html('div', { class: 'groups' });
    const none = html('p', { class: 'nothing', hidden: true });
    const all = html('fieldset', { class: 'all' }, groups, none, this.topics.element, this.file.element);
    const phone = html('button', { type: 'button', class: 'key wide' }, icon('phone'), 'Preferences of this device');
    const keys = html('div', { class: 'keys' }, phone);
    const close = html('button', { type: 'button', class: 'btn', 'aria-label': 'Close settings' }, icon('close'));
    this.panel.replaceChildren(
      html('div', { class: 'settings-head' }, html('h2', {}, 'Settings'), close),
      html('div', { class: 'find' }, html('div', { class: 'field' }, icon('find'), search), undo), state,
      all, this.mail.element, this.people.element, this.departure.element, this.devices.element, keys,
    );
    return { search, undo, state, groups, none, all, phone, keys, close };
  }

  stop() {
    for (const stop of this.stops) stop();
    for (const part of [...this.#groups, this.topics, this.file, this.mail, this.people, this.departure, this.devices]) part.stop();
    this.panel.replaceChildren();
  }

  begin() {
    this.#searchWanted();
    this.draw();
  }

  draw() {
    const { model, parts: { all, state, undo } } = this;
    model.look();
    if (!this.isShown()) return;
    this.#drawGroups();
    const { isOpen } = model;
    setAttribute(all, 'disabled', !isOpen);
    setSentence(state, stateWords(this.store, model));
    setAttribute(state, 'data-bad', !isOpen);
    this.#filter();
    for (const group of this.#groups) group.draw();
    this.topics.draw();
    this.file.draw();
    const lines = model.undoLines;
    setAttribute(undo, 'disabled', lines.length === 0 || !isOpen);
    setAttribute(undo, 'aria-label', lines.length ? `Undo ${lines.length > 1 ? counted(lines.length, 'change') : lines[0]}` : 'Undo');
  }

  #drawGroups() {
    const { model } = this;
    const { body } = model;
    const key = body ? Object.keys(body.schema).join() : '';
    if (!body || key === this.#built) return;
    this.#built = key;
    for (const group of this.#groups) group.stop();
    this.#groups = groupsOf(body.schema).map((group, i) => new SettingsGroup(model, group, i < OPEN_AT_FIRST));
    this.parts.groups.replaceChildren(html('div', { class: 'sec' }, html('span', {}, 'Limits'), html('span', {}, 'apply at once, recorded')), ...this.#groups.map((group) => group.element));
    this.#filter(true);
  }

  /** Searches for what another part of the page leads to. */
  #searchWanted() {
    const query = takeWanted();
    if (!query) return;
    /** @type {HTMLInputElement} */ (this.parts.search).value = query;
    this.#filter();
  }

  #filter(isForced = false) {
    const { search, keys, none } = this.parts;
    const query = search.value.trim();
    if (query === this.#query && !isForced) return;
    this.#query = query;
    const hits = [...this.#groups, this.topics, this.file, this.mail, this.people, this.departure, this.devices].reduce((sum, part) => sum + part.filter(query), 0);
    show(keys, query === '');
    if (!isForced) this.panel.scrollTop = 0;
    show(none, hits === 0 && query !== '');
    if (hits === 0) setText(none, `No setting matches “${query}”.`);
  }

  async #undo() {
    const lines = this.model.undoLines;
    const outcome = await this.model.undo();
    this.say(outcome.ok ? `${lines.join('. ')}.` : (outcome.reason ?? 'Refused.'), outcome.ok ? 'Taken back' : 'Not restored');
    this.draw();
  }

  /** Shows changes by others while the tab is in front. @param {import('../core/protocol-types.js').LogEvent[]} events */
  #announce(events) {
    const others = events.filter(({ change, by }) => change === 'settings' && by !== null && by !== (this.store.signs || this.store.name));
    if (others.length && this.isShown()) this.say(others.map(({ text }) => text).join('; '), `Changed by ${others.at(-1)?.by}`);
  }
}

/**
 * The state above the settings: empty while they can be changed.
 * @param {import('../core/store.js').Store} store
 * @param {import('./settings-model.js').SettingsModel} model
 */
function stateWords(store, model) {
  if (store.isSilent) return `The server does not answer: nothing can be changed. These are the settings of ${timeOfDay(store.heard_ms)}.`;
  if (!model.body) return model.problem ?? 'Loading the settings…';
  return model.problem ? `${model.problem} The list below may be outdated.` : '';
}
