// The Files tab: what was recorded, newest first, what is being recorded now, and the trash.

import { FileSheet } from './files-sheet.js';
import { FilesLive } from './files-live.js';
import { FilesSearch } from './files-search.js';
import { sizeWords } from './files-layout.js';
import { FilesModel } from './files-model.js';
import { drawRow } from './files-row.js';
import { html, icon, listen, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { counted, timeOfDay } from '../core/format.js';
import { styled } from '../core/style-sheet.js';

const SOON_S = 2; // while something is being read or has just ended
const SELDOM_S = 10;

/**
 * @param {HTMLElement} panel
 * @param {import('../shell/tab-contents.js').TabPage} page
 */
export function mount(panel, { store, say, isFront }) {
  const tab = new FilesTab(panel, store, say, isFront);
  tab.draw();
  tab.refresh();
  return {
    /** The tab came in front. */
    look: () => {
      tab.refresh(true);
      tab.draw();
    },
    stop: () => tab.stop(),
  };
}

class FilesTab {
  /** @type {Map<string, {key: string, element: HTMLElement}>} */
  #drawn = new Map();
  #requested_ms = -Infinity;
  #recording = '';
  #chosen = '';

  /**
   * @param {HTMLElement} panel
   * @param {import('../core/store.js').Store} store
   * @param {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} say
   * @param {() => boolean} isShown
   */
  constructor(panel, store, say, isShown) {
    this.panel = panel;
    this.store = store;
    this.isShown = isShown;
    const model = this.model = new FilesModel(() => this.draw());
    const dock = html('aside', { class: 'file-dock', 'aria-label': 'Chosen recording' });
    const sheet = this.sheet = new FileSheet(store, model, say, dock);
    this.search = new FilesSearch(model);
    this.live = new FilesLive(store, say);
    const { older, trash, back, clear } = this.parts = build(panel, this.search.element, this.live.element, dock);
    const files = /** @type {HTMLElement} */ (panel.firstElementChild);
    show(files, false);
    void styled('files').then(() => show(files, true));
    this.stops = [
      store.on('draw', () => this.#beat()),
      store.on('switch', () => this.#turned()),
      ...this.search.stops,
      listen(older, 'click', () => model.more()),
      listen(this.parts.logbook, 'click', () => this.#openLogbook(say)),
      listen(trash, 'click', () => this.#turnTo(true)),
      listen(back, 'click', () => this.#turnTo(false)),
      listen(clear, 'click', () => sheet.askEmpty(model.listing.trash ?? { count: model.rows.length, bytes: 0 })),
      listen(window, 'catgraph-units', () => this.draw()),
    ];
  }

  stop() {
    for (const stop of this.stops) stop();
    this.live.stop();
    this.sheet.stop();
    this.panel.replaceChildren();
  }

  /** All drives of a car. @param {(sentence: string, title?: string) => void} say */
  async #openLogbook(say) {
    const { vehicles = [], tags = [] } = this.model.listing;
    try {
      const { openLogbook } = await import('../drive/logbook.js');
      await openLogbook({ vehicles, tags, vehicle: this.model.rows[0]?.vehicle ?? '', store: this.store });
    } catch {
      say('The logbook could not be loaded from the server. Try again.', 'Not opened');
    }
  }

  /** Another car is shown, whose agent has other recordings. */
  #turned() {
    if (document.documentElement.dataset['kept'] !== 'agents') return;
    this.model.forget();
    this.refresh(true);
  }

  /** Fetches the list when it is due. @param {boolean} [isForced] */
  refresh(isForced = false) {
    const { model, store } = this;
    if (isForced) this.#requested_ms = -Infinity;
    if (!this.isShown()) return;
    const soon = model.listing.waiting || model.rows.some(({ state }) => state === 'waiting') || model.problem !== null;
    const due_ms = 1000 * (soon ? SOON_S : SELDOM_S);
    const now = `${store.heeded?.recording.state ?? ''} ${store.heeded?.session.phase ?? ''}`;
    const isOther = now !== this.#recording;
    if (!isOther && store.now() - this.#requested_ms < due_ms) return;
    this.#recording = now;
    this.#requested_ms = isOther ? store.now() - due_ms + 1000 * SOON_S : store.now(); // what has just ended is listed soon after
    model.refresh();
  }

  draw() {
    if (!this.isShown()) return;
    this.#drawHead();
    this.#drawLive();
    this.#drawList();
    this.#drawDock();
  }

  /** The recording beside the list: the one that was chosen, else the newest. */
  #drawDock() {
    const { rows } = this.model;
    const row = rows.find(({ id }) => id === this.#chosen) ?? rows[0];
    this.sheet.keep(row);
    for (const [id, { element }] of this.#drawn) setAttribute(element, 'data-chosen', id === row?.id);
  }

  /** Follows the frames. */
  #beat() {
    if (!this.isShown()) return;
    this.refresh();
    this.#drawLive();
    this.#drawDock();
    if (this.store.isSilent || this.parts.state.textContent) this.#drawHead();
  }

  #drawLive() {
    this.live.draw(!this.model.isTrash && !this.model.isFiltered);
  }

  #drawHead() {
    const { model, parts: { count, free, logbook, state, older, trash, back, clear } } = this;
    const { listing, isTrash } = model;
    const shown = isTrash ? listing.trash : model.isFiltered ? listing.found : listing.all;
    const total = shown ? `${counted(shown.count, 'recording')}${model.isFiltered && !isTrash ? ` of ${listing.all?.count ?? 0}` : ''}, ${sizeWords(shown.bytes)}` : '';
    const inStore = model.inStore !== null && shown ? `${counted(shown.count, 'recording')} in the store ${model.inStore}` : null;
    setSentence(count, inStore ?? (isTrash ? `Trash: ${total}` : total));
    setSentence(free, listing.free_bytes === null || listing.free_bytes === undefined ? '' : `${sizeWords(listing.free_bytes)} free`);
    setSentence(state, this.#stateWords());
    setAttribute(state, 'data-bad', model.problem !== null || Boolean(listing.store?.problem) || this.store.isSilent);
    this.search.draw();
    show(logbook, !isTrash && model.inStore === null && model.rows.length > 0);
    show(older, model.next !== null);
    show(trash, !isTrash && (listing.trash?.count ?? 0) > 0);
    if (listing.trash) setSentence(/** @type {HTMLElement} */ (trash.lastElementChild), `Trash: ${counted(listing.trash.count, 'recording')}, ${sizeWords(listing.trash.bytes)}`);
    show(back, isTrash);
    show(clear, isTrash && model.rows.length > 0);
  }

  #stateWords() {
    const { model: { at_ms, listing, problem }, store } = this;
    if (store.isSilent) return `The server does not answer: nothing can be opened.${at_ms === null ? '' : ` This was the list at ${timeOfDay(at_ms)}.`}`;
    if (problem !== null) return problem;
    if (listing.store?.problem) return listing.store.problem;
    return at_ms === null ? 'Loading the recordings…' : '';
  }

  #drawList() {
    const { list } = this.parts;
    const now_ms = Date.now();
    const today = new Date(now_ms).toDateString();
    const next = new Map(this.model.rows.map((row) => {
      const key = JSON.stringify([row, today, row.matched && this.model.text]);
      const old = this.#drawn.get(row.id);
      return [row.id, old && old.key === key ? old : { key, element: drawRow(row, now_ms, this.model.text, (one, from) => {
        from.focus({ preventScroll: true }); // the sheet returns the focus to it
        this.#chosen = one.id;
        this.sheet.open(one);
        this.#drawDock();
      }) }];
    }));
    const elements = [...next.values()].map(({ element }) => element);
    if (elements.length !== list.children.length || elements.some((element, i) => list.children[i] !== element)) {
      const focused = /** @type {HTMLElement | null} */ (document.activeElement?.closest('.file'))?.dataset['id'];
      list.replaceChildren(...elements);
      if (focused !== undefined && !list.contains(document.activeElement)) next.get(focused)?.element.querySelector('button')?.focus({ preventScroll: true });
    }
    this.#drawn = next;
    this.#drawEmpty();
  }

  #drawEmpty() {
    const { model, parts: { empty, emptyTitle, emptyWords } } = this;
    const isEmpty = model.rows.length === 0 && model.at_ms !== null && model.problem === null;
    show(empty, isEmpty);
    if (!isEmpty) return;
    setText(emptyTitle, model.isTrash ? 'The trash is empty' : model.isFiltered ? 'Nothing found' : 'No recordings yet');
    emptyWords.replaceChildren(...textNodes(model.isTrash ? 'Deleted recordings are kept here until the trash is emptied.' : model.isFiltered ? 'No name, note or tag matches.' : 'A drive is recorded while the car is monitored. It appears here when it ends.'));
  }

  /** @param {boolean} isTrash */
  #turnTo(isTrash) {
    this.panel.scrollTop = 0;
    this.model.want({ isTrash });
    this.draw();
    (isTrash ? this.parts.back : this.parts.trash).focus({ preventScroll: true });
  }
}

/** Builds the parts of the tab in `panel`. @param {HTMLElement} panel @param {HTMLElement} search @param {HTMLElement} live @param {HTMLElement} dock */
function build(panel, search, live, dock) {
  const [count, free] = [html('span'), html('span')];
  const logbook = html('button', { type: 'button', class: 'key', 'data-f': 'files-logbook' }, 'Logbook');
  const state = html('p', { class: 'state', role: 'status', 'data-f': 'files-state' });
  const list = html('ul', { class: 'list', 'data-f': 'recordings', 'aria-label': 'Recordings' });
  const [emptyTitle, emptyWords] = [html('h2'), html('p')];
  const empty = html('div', { class: 'empty', hidden: true }, icon('files', 'l'), emptyTitle, emptyWords);
  const older = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-older' }, 'Older recordings');
  const trash = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-trash' }, icon('trash'), html('span'));
  const back = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-back' }, icon('back'), html('span', {}, 'Back to the recordings'));
  const clear = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-empty' }, icon('trash'), html('span', {}, 'Empty the trash'));
  const heads = html('div', { class: 'files-heads', 'aria-hidden': 'true' }, ...['Track', 'Recording', 'Car', 'Length', 'Size', 'Critical', 'Warning'].map((name) => html('span', {}, name)));
  panel.replaceChildren(html('div', { class: 'files' },
    html('div', { class: 'files-side' }, html('div', { class: 'sec' }, html('p', {}, count, ' ', free), logbook), search, state, heads, live, list, empty, html('div', { class: 'files-foot' }, older, trash, back, clear)), dock));
  return { count, free, logbook, state, list, empty, emptyTitle, emptyWords, older, trash, back, clear };
}
