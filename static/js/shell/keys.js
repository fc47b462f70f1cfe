// The keys of the page: declared once, handled and shown from here. None of them orders a slow-down.

import { addSheet, closeSheet, openSheet } from './sheet.js';
import { field, html, listen, need, setText, textNodes } from '../core/dom.js';
import { isFloor } from './layout.js';
import { styled } from '../core/style-sheet.js';

/**
 * @typedef {'acknowledge' | 'silence' | 'mark' | 'tab' | 'help' | 'watch' | 'play' | 'step'} Act
 * @typedef {{keys: string[], shown: string, act: Act, does: string, isElsewhere?: boolean}} Key isElsewhere: the replay handles it itself
 */

/** @type {readonly Key[]} */
export const KEYS = [
  { keys: ['a'], shown: 'A', act: 'acknowledge', does: 'Acknowledge the first alarm of the list' },
  { keys: ['s'], shown: 'S', act: 'silence', does: 'Silence the first alarm of the list for 30 s' },
  { keys: ['m', 'AudioVolumeUp', 'MediaTrackNext'], shown: 'M', act: 'mark', does: 'Mark this moment; the key of a Bluetooth shutter does so too, where the browser passes it' },
  { keys: ['1', '2', '3', '4', '5', '6'], shown: '1 2 3 …', act: 'tab', does: 'The tabs, from the left' },
  { keys: ['Escape'], shown: 'Esc', act: 'watch', does: 'Back to the first tab; closes a comparison' },
  { keys: [' '], shown: 'Space', act: 'play', does: 'Play or pause the replay', isElsewhere: true },
  { keys: ['ArrowLeft', 'ArrowRight'], shown: '← →', act: 'step', does: 'Move in the replay', isElsewhere: true },
  { keys: ['[', ']', '{', '}'], shown: '[ ]', act: 'step', does: 'Move the second recording by 0.1 s, with Shift by 1 s', isElsewhere: true },
  { keys: ['?'], shown: '?', act: 'help', does: 'Show these keys' },
];

const STORED = 'catgraph.keys';
/** What came in sight a moment ago was not read yet [ms]. */
const READ_MS = 1000;
/** Who types or chooses there has another meaning for a key. */
const OWN_KEYS = '.view > .sheet, input, select, textarea, [contenteditable], [role="slider"], [role="application"]';

/**
 * The action of a key; null where it is not one of ours, or belongs to what has the focus.
 * @param {{key: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, defaultPrevented: boolean, repeat: boolean}} event
 * @param {{isTaken: boolean, isOn: boolean, isTouch?: boolean}} page isTaken: a field, a slider or a dialog has the keys
 * @returns {Key | null}
 */
export function keyOf(event, { isTaken, isOn, isTouch }) {
  if (event.key === 'AudioVolumeUp' && !isTouch) return null; // the keyboard's own
  if (isTaken || !isOn || event.defaultPrevented || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return null;
  const found = KEYS.find(({ keys }) => keys.includes(event.key) || keys.includes(event.key.toLowerCase()));
  return found && !found.isElsewhere ? found : null;
}

/**
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 * @param {import('./tabs.js').Tabs} tabs
 * @param {(sentence: string, title?: string) => void} say
 */
export function mount(monitor, store, tabs, say) {
  const keys = new PageKeys(monitor, store, tabs, say);
  const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
  const stops = [
    store.on('draw', () => keys.look()),
    listen(document, 'keydown', (event) => keys.press(event)),
    listen(field(menu, 'keys'), 'click', () => {
      closeSheet(menu);
      keys.help();
    }),
  ];
  return () => stops.forEach((stop) => stop());
}

class PageKeys {
  /** What each answering key would answer, and since when that is in sight. @type {Record<'acknowledge' | 'silence', {alarm: string, since_ms: number}>} */
  #seen = { acknowledge: { alarm: '', since_ms: 0 }, silence: { alarm: '', since_ms: 0 } };
  #isOn = recall();

  /** @param {HTMLElement} monitor @param {import('../core/store.js').Store} store @param {import('./tabs.js').Tabs} tabs @param {(sentence: string, title?: string) => void} say */
  constructor(monitor, store, tabs, say) {
    this.monitor = monitor;
    this.store = store;
    this.tabs = tabs;
    this.say = say;
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const at = event.target;
    const isTaken = Boolean(this.monitor.hidden) || document.querySelector('dialog:modal') !== null || (at instanceof Element && at.closest(OWN_KEYS) !== null);
    const found = keyOf(event, { isTaken, isOn: this.#isOn, isTouch: matchMedia('(pointer: coarse)').matches });
    if (!found) return;
    const { act } = found;
    if (act === 'help') this.help();
    else if (act === 'mark') this.#mark();
    else if (act === 'tab') this.#tab(Number(event.key) - 1);
    else if (act === 'watch') {
      if (!this.monitor.dataset['over'] && this.monitor.dataset['wide'] !== 'pane') this.tabs.go(0); // a screen closes itself
    } else if (act === 'acknowledge' || act === 'silence') this.#answer(act);
  }

  /** Notes since when the alarm that needs an answer is in sight. */
  look() {
    for (const act of /** @type {const} */ (['acknowledge', 'silence'])) {
      const label = this.#keyFor(act)?.getAttribute('aria-label') ?? '';
      const alarm = label && `${label} ${this.store.frame?.alarms.map(({ id, occurrence, state }) => `${id} ${occurrence} ${state}`).join()}`;
      if (alarm !== this.#seen[act].alarm) this.#seen[act] = { alarm, since_ms: this.store.now() };
    }
  }

  /** The key on the page that a key of the keyboard stands for: of the first row in sight that has one. @param {'acknowledge' | 'silence'} act */
  #keyFor(act) {
    if (!isFloor() || this.monitor.dataset['wide'] === 'page') return null;
    return /** @type {HTMLElement | null} */ (this.monitor.querySelector(`[data-pane="alarms"] :is([open], li:not([hidden])) [data-do="${act}"]:not([hidden])`));
  }

  /** @param {'acknowledge' | 'silence'} act */
  #answer(act) {
    const key = this.#keyFor(act);
    if (!key) return;
    this.look();
    if (this.store.now() - this.#seen[act].since_ms < READ_MS) this.say('The list changed a moment ago. Read it, then press the key again.', act === 'acknowledge' ? 'Not acknowledged' : 'Not silenced');
    else key.click();
  }

  /** As a tap on the Mark key, where it stands. */
  #mark() {
    const key = /** @type {HTMLElement | null} */ (this.monitor.querySelector('[data-f="mark"]'));
    if (key?.checkVisibility()) key.click();
  }

  /** @param {number} place */
  #tab(place) {
    const index = this.tabs.order[place];
    if (index !== undefined) this.tabs.go(index);
  }

  help() {
    void styled('menu');
    const toggle = html('button', { type: 'button', class: 'key' });
    const label = () => setText(toggle, this.#isOn ? 'Turn these keys off' : 'Turn these keys on');
    label();
    const sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-keys', 'aria-labelledby': 'keys-title' },
      html('div', { class: 'bd' }, html('h2', { id: 'keys-title' }, 'Keys'), html('p', { class: 'sub small' }, ...textNodes('No key orders a slow-down. Saved on this device only.'))),
      html('dl', { class: 'key-list' }, ...KEYS.flatMap(({ shown, does }) => [html('dt', {}, html('kbd', {}, shown)), html('dd', {}, ...textNodes(does))])),
      html('div', { class: 'keys' }, toggle, html('button', { type: 'button', class: 'key', 'data-f': 'no', autofocus: true }, 'Close'))));
    const take = addSheet(sheet);
    listen(sheet, 'close', take);
    listen(toggle, 'click', () => {
      this.#isOn = !this.#isOn;
      keep(this.#isOn);
      label();
    });
    openSheet(sheet);
  }
}

function recall() {
  try {
    return localStorage.getItem(STORED) !== 'off';
  } catch {
    return true;
  }
}

/** @param {boolean} isOn */
function keep(isOn) {
  try {
    localStorage.setItem(STORED, isOn ? 'on' : 'off');
  } catch {
    // no storage: it holds until the page is loaded again
  }
}
