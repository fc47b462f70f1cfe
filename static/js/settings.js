// The Settings tab: every threshold under its heading, the topics of the signals, the kind of car, the file of all of it.

import { SettingsDevices } from './settings-devices.js';
import { SettingsFileKeys } from './settings-file.js';
import { SettingsGroup } from './settings-group.js';
import { SettingsMail } from './settings-mail.js';
import { groupsOf } from './settings-layout.js';
import { settingsOf } from './settings-model.js';
import { SettingsTopics } from './settings-topics.js';
import { openPreferences } from './preferences.js';
import { html, icon, listen, setAttribute, setText, setWords, show } from './dom.js';
import { counted, timeOfDay } from './words.js';

/** Headings that stand open at first: what is set on the field. */
const OPEN_AT_FIRST = 2;

/**
 * @param {HTMLElement} panel
 * @param {import('./store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 * @param {() => boolean} isShown whether any of it can be seen now
 * @returns {() => void}
 */
export function mount(panel, store, say, isShown) {
  const model = settingsOf(store);
  const search = /** @type {HTMLInputElement} */ (html('input', {
    type: 'search', placeholder: 'Search', 'aria-label': 'Search the settings', autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false', enterkeyhint: 'search', maxlength: 60,
  }));
  const undo = html('button', { type: 'button', class: 'key wide undo', disabled: true }, icon('replay'), html('span', {}, 'Undo'));
  const state = html('p', { class: 'state', role: 'status' });
  const groups = html('div', { class: 'groups' });
  const none = html('p', { class: 'nothing', hidden: true });
  const topics = new SettingsTopics(store, model);
  const file = new SettingsFileKeys(store, model, say);
  const mail = new SettingsMail(say);
  const devices = new SettingsDevices(store, say);
  const phone = html('button', { type: 'button', class: 'key wide' }, icon('phone'), 'Preferences of this phone');
  const all = html('fieldset', { class: 'all' }, groups, none, topics.element, file.element);
  const keys = html('div', { class: 'keys' }, phone);
  panel.replaceChildren(
    html('div', { class: 'find' }, html('div', { class: 'field' }, icon('search'), search), undo), state,
    all, mail.element, devices.element, keys,
  );
  /** @type {SettingsGroup[]} */
  let shown = [];
  let built = '';
  let drawnQuery = '';

  function build() {
    const { body } = model;
    const key = body ? Object.keys(body.schema).join() : '';
    if (!body || key === built) return;
    built = key;
    for (const group of shown) group.stop();
    shown = groupsOf(body.schema).map((group, i) => new SettingsGroup(model, group, i < OPEN_AT_FIRST));
    groups.replaceChildren(html('div', { class: 'sec' }, html('span', {}, 'Limits'), html('span', {}, 'apply at once, recorded')), ...shown.map((group) => group.element));
    filter(true);
  }

  function filter(isForced = false) {
    const query = search.value.trim();
    if (query === drawnQuery && !isForced) return;
    drawnQuery = query;
    const hits = shown.reduce((sum, group) => sum + group.filter(query), 0) + topics.filter(query) + file.filter(query) + mail.filter(query) + devices.filter(query);
    show(keys, query === '');
    if (!isForced) panel.scrollTop = 0;
    show(none, hits === 0 && query !== '');
    if (hits === 0) setText(none, `No setting matches “${query}”.`);
  }

  function draw() {
    model.look();
    if (!isShown()) return;
    build();
    const isOpen = model.isOpen;
    setAttribute(all, 'disabled', !isOpen);
    setWords(state, stateWords(store, model));
    setAttribute(state, 'data-bad', !isOpen);
    filter();
    for (const group of shown) group.draw();
    topics.draw();
    file.draw();
    const lines = model.undoLines;
    setAttribute(undo, 'disabled', lines.length === 0 || !isOpen);
    setAttribute(undo, 'aria-label', lines.length ? `Undo ${lines.length > 1 ? counted(lines.length, 'change') : lines[0]}` : 'Undo');
  }

  const stops = [
    store.on('draw', draw),
    listen(search, 'input', () => filter()),
    listen(undo, 'click', async () => {
      const lines = model.undoLines;
      const outcome = await model.undo();
      say(outcome.ok ? `${lines.join('. ')}.` : (outcome.reason ?? 'Refused.'), outcome.ok ? 'Taken back' : 'Not taken back');
      draw();
    }),
    listen(phone, 'click', openPreferences),
    listen(window, 'catgraph-units', draw),
    store.on('log', (events) => heard(events)),
  ];

  /** What others change is said while it is looked at. @param {import('./protocol.js').AlarmEvent[]} events */
  function heard(events) {
    const others = events.filter(({ change, by }) => change === 'settings' && by !== null && by !== store.name);
    if (others.length && isShown()) say(others.map(({ text }) => text).join('; '), `Changed by ${others.at(-1)?.by}`);
  }

  draw();
  return () => {
    for (const stop of stops) stop();
    for (const group of shown) group.stop();
    topics.stop();
    file.stop();
    mail.stop();
    devices.stop();
    panel.replaceChildren();
  };
}

/**
 * What stands above the settings: nothing while all is well.
 * @param {import('./store.js').Store} store
 * @param {import('./settings-model.js').SettingsModel} model
 */
function stateWords(store, model) {
  if (store.isSilent) return `The server does not answer: nothing can be changed. These were the settings at ${timeOfDay(store.heard_ms)}.`;
  if (!model.body) return model.problem ?? 'The settings are being fetched from the server.';
  return model.problem ? `${model.problem} What follows may be old.` : '';
}
