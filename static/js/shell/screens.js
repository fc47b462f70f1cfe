// The screens behind the menu: each slides over the tabs and keeps bar, strip and rail in their places.

import { openPreferences } from './preferences.js';
import { closeSheet, openSheet } from './sheet.js';
import { field, html, listen, need, setText, show, words } from '../core/dom.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {(root: HTMLElement, store: Store) => (() => void)} Mount
 */

// Each is fetched when it is first opened: a page that begins has enough to load.
const SCREENS = /** @type {Record<string, {title: string, load: () => Promise<Mount>}>} */ ({
  alarms: { title: 'Alarms', load: async () => (await import('../alarms/alarms.js')).mount },
  log: { title: 'Alarm log', load: async () => (await import('../alarms/log.js')).mount },
  signals: { title: 'Signals', load: async () => (await import('../home/signals.js')).mount },
  license: { title: 'License', load: async () => (await import('./about.js')).mountLicense },
  about: { title: 'About', load: async () => (await import('./about.js')).mountAbout },
});
const NOT_HERE = still(['This screen could not be fetched from the server. Go back and open it again.']);

export class Screens {
  /** @type {(() => void) | null} */
  #unmount = null;
  /** @type {string | null} */
  open = null;

  /**
   * @param {HTMLElement} root the monitor's board
   * @param {Store} store
   * @param {(screen: string | null) => void} onChange
   */
  constructor(root, store, onChange) {
    this.root = root;
    this.store = store;
    this.onChange = onChange;
    this.menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
    this.stops = [
      listen(field(root, 'menu'), 'click', () => openSheet(this.menu)),
      listen(field(root, 'back'), 'click', () => this.show(null)),
      listen(field(root, 'link'), 'click', () => this.show('signals')),
      listen(field(root, 'strip'), 'click', () => this.show(field(root, 'strip').dataset['opens'] ?? 'alarms')),
      listen(field(root, 'screen'), 'click', (event) => {
        const name = /** @type {HTMLElement | null} */ (event.target.closest('button[data-screen]'))?.dataset['screen'];
        if (name) this.show(name); // a key of one screen that leads to another
      }),
      listen(window, 'popstate', () => this.#set(history.state?.screen ?? null)),
      listen(window, 'catgraph-units', () => this.#again()), // what it told stands there in the unit of before
      listen(document, 'keydown', (event) => {
        if (event.key === 'Escape' && this.open && !document.querySelector('dialog[open]')) this.show(null);
      }),
      ...[.../** @type {NodeListOf<HTMLElement>} */ (this.menu.querySelectorAll('[data-screen]'))].map((key) => listen(key, 'click', () => {
        closeSheet(this.menu);
        const name = key.dataset['screen'] ?? null;
        if (name === 'preferences') openPreferences();
        else if (name === 'saved') this.#tab('files');
        else this.show(name);
      })),
    ];
    if (history.state?.screen) history.replaceState(null, '');
  }

  /**
   * Open a screen, or with null go back to the tabs. The phone's back key does the same.
   * @param {string | null} name
   */
  show(name) {
    if (name === this.open) return;
    if (name === null) history.back();
    else {
      history[this.open ? 'replaceState' : 'pushState']({ screen: name }, '');
      this.#set(name);
    }
  }

  /** From wherever the menu was opened to a tab. @param {string} tab */
  #tab(tab) {
    const go = () => { location.hash = `#${tab}`; };
    if (this.open === null) go();
    else {
      window.addEventListener('popstate', go, { once: true });
      this.show(null);
    }
  }

  /** @param {string | null} name */
  #set(name) {
    if (name === this.open) return;
    this.#unmount?.();
    this.#unmount = null;
    const screen = name === null ? undefined : SCREENS[name];
    this.open = screen ? name : null;
    const place = field(this.root, 'screen');
    show(place, screen !== undefined);
    show(need(this.root, '.titlebar'), screen !== undefined);
    show(need(this.root, '.tabs'), screen === undefined);
    if (screen) {
      setText(field(this.root, 'title'), name === 'log' && this.store.replaying ? 'Alarm log of the live car' : screen.title);
      place.scrollTop = 0;
      this.#fill(place, screen.load);
      field(this.root, 'title').focus();
    }
    this.onChange(this.open);
  }

  /** The open screen, written anew. */
  #again() {
    const screen = this.open === null ? undefined : SCREENS[this.open];
    if (!screen) return;
    this.#unmount?.();
    this.#unmount = null;
    this.#fill(field(this.root, 'screen'), screen.load);
  }

  /**
   * @param {HTMLElement} place
   * @param {() => Promise<Mount>} load
   */
  async #fill(place, load) {
    const { open } = this;
    place.replaceChildren();
    const mount = await load().catch(() => NOT_HERE);
    if (this.open === open && !this.#unmount) this.#unmount = mount(place, this.store);
  }
}

/**
 * A screen of a few sentences.
 * @param {string[]} sentences
 * @returns {Mount}
 */
function still(sentences) {
  return (root) => {
    root.replaceChildren(html('div', { class: 'prose' }, ...sentences.map((sentence) => html('p', {}, ...words(sentence)))));
    return () => root.replaceChildren();
  };
}
