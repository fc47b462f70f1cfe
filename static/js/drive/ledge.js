// The ledge on the rail of the live tabs: at the left who drives, at the right the Mark key; above it the panel of a fresh mark.
// In a replay there is none: what is marked is the live drive.

import { FreshPanel } from './fresh-panel.js';
import { MarkKey } from './mark-key.js';
import { Marks, quietly } from './marks.js';
import { setShape, shape } from './drive-parts.js';
import { styled } from '../core/style-sheet.js';
import { html, listen, need, setAttribute, setText, show } from '../core/dom.js';
import { waitWords } from './mark-model.js';
import { closeSheet } from '../shell/sheet.js';

/** @typedef {import('../core/store.js').Store} Store */
/** @typedef {import('./marks.js').Say} Say */

const LIST_GONE = 'The list of marks could not be loaded from the server. Marks can still be placed.';

/**
 * @param {HTMLElement} monitor
 * @param {Store} store
 * @param {Say} say
 */
export async function mount(monitor, store, say) {
  await Promise.all([styled('drive'), styled('mode')]);
  return new Ledge(monitor, store, say);
}

class Ledge {
  #shown = '';

  /** @param {HTMLElement} monitor @param {Store} store @param {Say} say */
  constructor(monitor, store, say) {
    this.monitor = monitor;
    this.store = store;
    this.say = say;
    this.marks = new Marks(store, say);
    this.icon = shape('flag');
    this.hint = html('small', {}, 'hold: voice');
    this.wait = html('span', { class: 'wait', 'data-f': 'marks-wait', hidden: true });
    this.key = html('button', { type: 'button', class: 'mark-key', 'data-f': 'mark', 'data-operator': '' }, this.icon, html('span', {}, 'Mark', this.hint), this.wait);
    this.mode = html('div', { class: 'mode-slot', 'data-f': 'mode' });
    this.panel = html('div', { class: 'fresh-slot' });
    this.element = need(monitor, ':scope > .ledge');
    this.element.replaceChildren(this.panel, this.mode, this.key);
    this.fresh = new FreshPanel(this.panel, this.marks, say, { words: (id) => this.#openSheet(id), list: () => this.openList() });
    const press = new MarkKey(this.key, this.marks, say, this.fresh);
    const menu = this.#menuEntry();
    this.stops = [() => press.stop(), () => this.fresh.stop(), () => this.marks.stop(), menu, this.marks.onChange(() => quietly(() => this.draw())), store.on('draw', () => quietly(() => this.draw()))];
    this.draw();
    import('./mode-key.js').then(({ mountMode }) => this.stops.push(mountMode(this.mode, this.store, this.say))).catch(() => {}); // then nothing stands there
  }

  /** In the menu, for there is no room on a phone beside the key. */
  #menuEntry() {
    const menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
    const key = html('button', { type: 'button', 'data-f': 'marks' }, shape('flag'), 'Marks of this drive');
    const entry = html('li', {}, key);
    need(menu, '[data-screen="log"]').closest('li')?.after(entry);
    const stop = listen(key, 'click', () => {
      closeSheet(menu);
      this.openList();
    });
    return () => {
      stop();
      entry.remove();
    };
  }

  openList() {
    this.fresh.close();
    import('./mark-list.js').then(({ openMarkList }) => openMarkList(this.marks, this.say, (id) => this.#openSheet(id))).catch(() => this.say(LIST_GONE, 'Not opened'));
  }

  /** @param {string} id */
  #openSheet(id) {
    this.fresh.close();
    import('./mark-sheet.js').then(({ openMarkSheet }) => openMarkSheet(id, this.marks, this.say, () => this.openList())).catch(() => this.say('This part of the page could not be loaded from the server. The mark is stored; words can be added later.', 'Not opened'));
  }

  draw() {
    const { marks } = this;
    const waiting = marks.waiting.length;
    const isAway = !marks.isServerThere;
    const shown = `${waiting} ${isAway} ${marks.isDurable} ${this.key.dataset['held']}`;
    if (shown === this.#shown) return;
    this.#shown = shown;
    const isHeld = this.key.dataset['held'] !== undefined;
    setShape(this.icon, isHeld ? 'mic' : 'flag');
    setText(this.hint, isHeld ? 'let go: stored' : !isAway ? 'hold: voice' : marks.isDurable ? 'stored on this device' : 'until the page closes');
    show(this.wait, waiting > 0 && isAway);
    setText(this.wait, waitWords(waiting));
    setAttribute(this.key, 'aria-label', ['Mark this moment', isAway ? 'stored on this device' : 'hold to speak', ...(waiting && isAway ? [waitWords(waiting)] : [])].join('; '));
  }

  stop() {
    for (const stop of this.stops) stop();
    this.element.replaceChildren();
  }
}
