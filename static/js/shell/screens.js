// The screens behind the menu: each slides over the tabs and keeps bar, strip and rail in their places.

import { areAlarmsInSight, floorQuery, isFloor } from './layout.js';
import { mountHeadSpeed } from './head-speed.js';
import { openPreferences } from './preferences.js';
import { closeSheet, leaveSheet, openSheet } from './sheet.js';
import { field, html, listen, need, setAttribute, setText, show, textNodes } from '../core/dom.js';
import { styled } from '../core/style-sheet.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {(root: HTMLElement, store: Store, where: {close: () => void, say: (sentence: string, title?: string) => void, of?: string}) => (() => void)} Mount
 */

// Each is fetched when it is first opened: a page that begins has enough to load.
const SCREENS = /** @type {Record<string, {title: string, hasHead?: boolean, load: () => Promise<Mount>}>} */ ({
  alarms: { title: 'Alarms', hasHead: true, load: async () => (await Promise.all([import('../alarms/alarms.js'), styled('drawers')]))[0].mount },
  check: { title: 'Check', hasHead: true, load: async () => (await Promise.all([import('../alarms/check.js'), styled('check')]))[0].mount },
  departure: { title: 'Departure check', load: async () => (await import('../drive/departure-check.js')).mount },
  log: { title: 'Alarm log', load: async () => (await Promise.all([import('../alarms/log.js'), styled('menu')]))[0].mount },
  trends: { title: 'Trends', load: async () => (await import('../home/drive-screen.js')).mount },
  signals: { title: 'Signals', load: async () => (await Promise.all([import('../home/signals.js'), styled('sources')]))[0].mount },
  license: { title: 'License', load: async () => (await Promise.all([import('./about.js'), styled('menu')]))[0].mountLicense },
  about: { title: 'About', load: async () => (await import('./about.js')).mountAbout },
});
const NOT_HERE = still(['This screen could not be loaded from the server. Go back and open it again.']);

/** Which screens one leads to, and back from. */
const LEADS = /** @type {Record<string, string[]>} */ ({ alarms: ['check'], check: ['trends'], departure: ['check', 'signals'] });

export class Screens {
  /** @type {(() => void) | null} */
  #unmount = null;
  /** @type {string | null} */
  open = null;
  /** What the open screen is of. @type {string | undefined} */
  #of;

  /**
   * @param {HTMLElement} root the monitor's board
   * @param {Store} store
   * @param {(screen: string | null) => void} onChange
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(root, store, onChange, say) {
    this.root = root;
    this.say = say;
    this.store = store;
    this.onChange = onChange;
    this.menu = /** @type {HTMLDialogElement} */ (need(document, '#sheet-menu'));
    this.stops = [
      mountHeadSpeed(need(root, '.titlebar'), store),
      listen(field(root, 'menu'), 'click', () => openSheet(this.menu)),
      listen(field(root, 'back'), 'click', () => this.show(null)),
      listen(field(root, 'link'), 'click', () => this.show('signals')),
      listen(root, 'click', (event) => {
        const name = /** @type {HTMLElement | null} */ (event.target.closest('[data-age-of]'))?.dataset['ageOf'];
        if (name) this.show('signals', name); // the age of a value leads to what stands behind it
      }),
      listen(field(root, 'strip'), 'click', () => this.show(field(root, 'strip').dataset['opens'] ?? 'alarms')),
      listen(need(root, '.tabs'), 'click', (event) => {
        const tab = /** @type {HTMLElement | null} */ (event.target.closest('[data-tab]'))?.dataset['tab'];
        if (!tab || this.open === null) return;
        event.stopPropagation(); // the screen goes first, and the address of before with it
        this.#tab(tab);
      }, { capture: true }),
      listen(field(root, 'screen'), 'click', (event) => {
        const name = /** @type {HTMLElement | null} */ (event.target.closest('button[data-screen]'))?.dataset['screen'];
        if (name) this.show(name); // a key of one screen that leads to another
      }),
      listen(floorQuery(), 'change', () => this.#showHead()),
      listen(window, 'popstate', () => this.#set(history.state?.screen ?? null, history.state?.of)),
      listen(window, 'catgraph-open', ({ detail: { screen, of } }) => this.show(screen, of)), // any part of the page opens one
      store.on('switch', () => {
        const off = store.on('beat', () => {
          off();
          this.#again();
        });
      }),
      listen(window, 'catgraph-units', () => this.#again()), // its texts still have the unit of before
      listen(document, 'keydown', (event) => {
        if (event.key === 'Escape' && this.open && !document.querySelector('dialog:modal')) this.show(null);
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
   * Open a screen, or with null go back to where it was opened. The phone's back key does the same.
   * What is opened from the list of alarms or from a check leads back to it.
   * @param {string | null} name
   * @param {string} [of]
   */
  show(name, of) {
    if (name === this.open && of === this.#of) return;
    const stage = /** @type {HTMLElement | null} */ (this.root.querySelector('[data-part="trends"] .trends-stage')); // in its pane
    if (name === 'alarms' && areAlarmsInSight()) field(this.root, 'pane-alarms').focus();
    else if (name === 'trends' && areAlarmsInSight() && stage?.checkVisibility()) stage.focus();
    else if (name === null) history.back();
    else {
      const isDeeper = this.open === null || LEADS[this.open]?.includes(name) === true;
      const go = () => {
        const depth = history.state?.depth ?? 0;
        history[isDeeper ? 'pushState' : 'replaceState']({ screen: name, of, depth: isDeeper ? depth + 1 : depth }, '');
        this.#set(name, of);
      };
      if (this.open === null) go();
      else this.#past(0, go);
    }
  }

  /** From wherever the menu was opened to a tab. @param {string} tab */
  #tab(tab) {
    const go = () => { location.hash = `#${tab}`; };
    if (this.open === null) go();
    else this.#past(history.state?.depth ?? 1, go);
  }

  /** So many entries back, and past that of a sheet that lay over the screen (back.js); then `go`. @param {number} steps @param {() => void} go */
  #past(steps, go) {
    const { over, ...state } = history.state ?? {};
    const back = over ? steps + 1 : steps;
    if (back === 0) return go();
    if (over) history.replaceState(state, ''); // it is not tidied meanwhile
    leaveSheet();
    window.addEventListener('popstate', go, { once: true });
    history.go(-back);
  }

  /** @param {string | null} name @param {string} [of] */
  #set(name, of) {
    if (name === this.open && of === this.#of) return;
    this.#unmount?.();
    this.#unmount = null;
    const screen = name === null ? undefined : SCREENS[name];
    this.open = screen ? name : null;
    this.#of = screen ? of : undefined;
    const place = field(this.root, 'screen');
    show(place, screen !== undefined);
    this.#showHead();
    if (screen) {
      setText(field(this.root, 'title'), name === 'log' && this.store.replaying ? 'Alarm log of the live car' : screen.title);
      place.scrollTop = 0;
      this.#fill(place, screen.load);
      if (!screen.hasHead) field(this.root, 'title').focus();
    }
    this.onChange(this.open);
  }

  /** One with a head of its own leaves the tabs in sight; so does any beside the panes of a desktop. */
  #showHead() {
    const screen = this.open === null ? undefined : SCREENS[this.open];
    const isTitled = screen !== undefined && !screen.hasHead;
    setAttribute(this.root, 'data-over', screen === undefined ? null : isTitled ? 'titled' : 'headed');
    show(need(this.root, '.titlebar'), isTitled);
    show(need(this.root, '.tabs'), !isTitled || isFloor());
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
    const open = this.open;
    const of = this.#of;
    place.replaceChildren();
    const mount = await load().catch(() => NOT_HERE);
    if (this.open !== open || this.#of !== of || this.#unmount) return;
    this.#unmount = mount(place, this.store, { close: () => this.show(null), say: this.say, ...(of === undefined ? {} : { of }) });
    if (SCREENS[open ?? '']?.hasHead) place.querySelector('h2')?.focus();
  }
}

/**
 * A screen of a few sentences.
 * @param {string[]} sentences
 * @returns {Mount}
 */
function still(sentences) {
  return (root) => {
    root.replaceChildren(html('div', { class: 'prose' }, ...sentences.map((sentence) => html('p', {}, ...textNodes(sentence)))));
    return () => root.replaceChildren();
  };
}
