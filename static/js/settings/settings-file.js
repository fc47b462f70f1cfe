// The kind of car, and all settings as one file: kept on this phone, taken from it, or given up for the defaults.

import { field, html, icon, listen, need, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { found } from './settings-layout.js';
import { closeSheet, openSheet } from '../shell/sheet.js';
import { counted } from '../core/format.js';

/** As the server has it. */
const MAX_BYTES = 64 * 1024;

/**
 * Why a file cannot hold settings, before it is sent; null: it may.
 * @param {{size: number, name: string}} file
 */
export function fileProblem({ size, name }) {
  if (size === 0) return `“${name.slice(0, 60)}” is empty.`;
  if (size > MAX_BYTES) return `“${name.slice(0, 60)}” is too large: a settings file has at most 64 kB.`;
  return null;
}

export class SettingsFileKeys {
  /**
   * @param {import('../core/store.js').Store} store
   * @param {import('./settings-model.js').SettingsModel} model
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(store, model, say) {
    this.store = store;
    this.model = model;
    this.say = say;
    this.kind = html('span', { class: 'm' });
    const profile = html('button', { type: 'button', class: 'topic', 'data-part': 'profile' }, icon('car'), html('span', { class: 'p' }, 'Kind of car'), this.kind, html('span', { class: 'r' }, icon('next')));
    const save = html('button', { type: 'button', class: 'key wide', 'data-part': 'export' }, icon('download'), 'Export');
    const load = html('button', { type: 'button', class: 'key wide', 'data-part': 'import' }, icon('files'), 'Import');
    this.picker = /** @type {HTMLInputElement} */ (html('input', { type: 'file', accept: '.toml,application/toml,text/plain', class: 'unseen', tabindex: -1, 'aria-label': 'Settings file' }));
    this.resetKey = html('button', { type: 'button', class: 'key wide', 'data-part': 'reset' }, icon('replay'), html('span', {}, 'Reset all'));
    this.car = html('section', { 'aria-label': 'Car' }, html('div', { class: 'sec' }, html('span', {}, 'Car')), profile);
    this.all = html('section', { 'aria-label': 'All settings' }, html('div', { class: 'sec' }, html('span', {}, 'All settings'), html('span', {}, 'as a TOML file')),
      html('div', { class: 'keys' }, html('div', { class: 'pair' }, save, load), this.resetKey, this.picker));
    this.element = html('div', {}, this.car, this.all);
    this.sheets = { profile: sheetOf('profile'), reset: sheetOf('reset') };
    this.stops = [
      listen(profile, 'click', () => this.#openProfiles()),
      listen(save, 'click', () => this.#export()),
      listen(load, 'click', () => this.picker.click()),
      listen(this.picker, 'change', () => this.#import()),
      listen(this.resetKey, 'click', () => this.#openReset()),
      listen(field(this.sheets.reset, 'yes'), 'click', () => this.#reset()),
    ];
  }

  draw() {
    const { body } = this.model;
    if (!body) return;
    setText(this.kind, body.profile.chosen === 'auto' ? `${body.profile.title}, as recognised` : `${body.profile.title}, chosen`);
    setAttribute(this.resetKey, 'disabled', this.model.resetLines.length === 0);
  }

  /** Shows what a search matches; returns how many there are. @param {string} query */
  filter(query) {
    const isCar = found(query, ['kind of car profile', this.model.body?.profile.title]);
    const isFile = found(query, ['all settings export import reset defaults toml file']);
    show(this.car, isCar);
    show(this.all, isFile);
    return Number(isCar) + Number(isFile);
  }

  stop() {
    for (const stop of this.stops) stop();
  }

  #openProfiles() {
    const { body } = this.model;
    const sheet = this.sheets.profile;
    if (!body) return;
    setSentence(field(sheet, 'refused'), '');
    const options = [
      { name: 'auto', title: 'As recognised', detail: `now ${body.profile.recognised}` },
      ...body.profiles.map(({ name, title }) => ({ name, title, detail: '' })),
    ];
    field(sheet, 'list').replaceChildren(...options.map(({ name, title, detail }) => {
      const isChosen = body.profile.chosen === name;
      const mark = icon('ok');
      show(mark, isChosen);
      const key = html('button', { type: 'button', 'aria-pressed': String(isChosen) }, html('span', { class: 'tx' }, html('b', {}, title), html('small', {}, detail)), mark);
      key.addEventListener('click', async () => {
        const outcome = await this.model.set({ profile: name });
        if (outcome.ok) closeSheet(sheet);
        else setSentence(field(sheet, 'refused'), `Not changed. ${outcome.reason}`);
      });
      return html('li', {}, key);
    }));
    openSheet(sheet);
  }

  async #export() {
    try {
      const url = URL.createObjectURL(new Blob([await this.model.toml()], { type: 'application/toml' }));
      html('a', { href: url, download: `catgraph-${this.store.frame?.vehicle ?? 'settings'}.toml` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60_000);
    } catch (error) {
      this.say(error instanceof Error ? error.message : 'The server does not answer.', 'Not exported');
    }
  }

  async #import() {
    const file = this.picker.files?.[0];
    this.picker.value = ''; // the same file can be picked again
    if (!file) return;
    const problem = fileProblem(file);
    const text = problem === null ? await textOf(file) : null;
    if (problem !== null || text === null) {
      this.say(problem ?? `“${file.name.slice(0, 60)}” is not text.`, 'Not imported');
      return;
    }
    const before = this.model.body?.version;
    const outcome = await this.model.replace(text);
    if (!outcome.ok) this.say(`${outcome.reason} Nothing was changed.`, 'Not imported');
    else if (this.model.body?.version === before) this.say('It contains the settings already in force.', 'Imported');
    else this.say(`${counted(this.model.undoLines.length, 'setting')} changed. Undo reverts it.`, 'Imported');
  }

  #openReset() {
    const sheet = this.sheets.reset;
    setSentence(field(sheet, 'refused'), '');
    field(sheet, 'list').replaceChildren(...this.model.resetLines.map((line) => html('li', {}, ...textNodes(line))));
    openSheet(sheet);
  }

  async #reset() {
    const outcome = await this.model.reset();
    if (outcome.ok) closeSheet(this.sheets.reset);
    else setSentence(field(this.sheets.reset, 'refused'), `Not changed. ${outcome.reason}`);
  }
}

/** @param {string} name */
function sheetOf(name) {
  return /** @type {HTMLDialogElement} */ (need(document, `#sheet-${name}`));
}

/** Its text, or null where it is none. @param {File} file */
async function textOf(file) {
  try {
    return new TextDecoder('utf-8', { fatal: true }).decode(await file.arrayBuffer());
  } catch {
    return null;
  }
}
