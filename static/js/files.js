// The Files tab: what was recorded, newest first, what is being recorded now, and the trash.

import { FileSheet } from './files-sheet.js';
import { FilesLive } from './files-live.js';
import { choiceOf, sizeWords } from './files-layout.js';
import { FilesModel, sentenceOf } from './files-model.js';
import { drawRow } from './files-row.js';
import { html, icon, listen, setAttribute, setText, setWords, show, words } from './dom.js';
import { counted, timeOfDay } from './words.js';

/** @typedef {import('./files-layout.js').Recording} Recording */

const SOON_S = 2; // while something is being read or has just ended
const SELDOM_S = 10;
const FEW = 5; // recordings that are seen at one glance: no search is needed

/**
 * @param {HTMLElement} panel
 * @param {import('./store.js').Store} store
 * @param {(sentence: string, title?: string, way?: import('./notice.js').Way) => void} say
 * @param {() => boolean} isShown whether any of it can be seen now
 */
export function mount(panel, store, say, isShown) {
  const model = new FilesModel(() => draw());
  const sheet = new FileSheet(store, model, say);

  const search = /** @type {HTMLInputElement} */ (html('input', {
    type: 'search', placeholder: 'Search', 'aria-label': 'Search the recordings', autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false', enterkeyhint: 'search', maxlength: 100,
  }));
  const select = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': 'Which recordings' }));
  const find = html('div', { class: 'files-find', hidden: true }, html('div', { class: 'field' }, icon('search'), search), select);
  const count = html('span');
  const free = html('span');
  const state = html('p', { class: 'state', role: 'status', 'data-f': 'files-state' });
  const live = new FilesLive(store, say);
  const list = html('ul', { class: 'list', 'data-f': 'recordings', 'aria-label': 'Recordings' });
  const emptyTitle = html('h2');
  const emptyWords = html('p');
  const empty = html('div', { class: 'empty', hidden: true }, icon('files', 'l'), emptyTitle, emptyWords);
  const older = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-older' }, 'Older recordings');
  const trash = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-trash' }, icon('trash'), html('span'));
  const back = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-back' }, icon('back'), html('span', {}, 'Back to the recordings'));
  const clear = html('button', { type: 'button', class: 'key wide', 'data-f': 'files-empty' }, icon('trash'), html('span', {}, 'Empty the trash'));
  const files = html('div', { class: 'files' }, html('div', { class: 'sec' }, count, free), find, state, live.element, list, empty, html('div', { class: 'files-foot' }, older, trash, back, clear));
  panel.replaceChildren(files);
  if (!document.querySelector('link[data-files]')) {
    const style = /** @type {HTMLLinkElement} */ (html('link', { rel: 'stylesheet', href: '/static/css/files.css', 'data-files': true }));
    style.onload = style.onerror = () => show(files, true); // not seen before it looks as it should
    show(files, false);
    document.head.append(style);
  }

  /** @type {Map<string, {key: string, element: HTMLElement}>} */
  let drawn = new Map();
  let asked_ms = -Infinity;
  let recording = '';
  let options = '';

  function look() {
    if (!isShown()) return;
    const soon = model.listing.waiting || model.rows.some(({ state: one }) => one === 'waiting') || model.problem !== null;
    const due_ms = 1000 * (soon ? SOON_S : SELDOM_S);
    const now = `${store.heeded?.recording.state ?? ''} ${store.heeded?.session.phase ?? ''}`;
    const isOther = now !== recording;
    if (!isOther && store.now() - asked_ms < due_ms) return;
    recording = now;
    asked_ms = isOther ? store.now() - due_ms + 1000 * SOON_S : store.now(); // what has just ended is listed soon after
    model.refresh();
  }

  function draw() {
    if (!isShown()) return;
    drawHead();
    live.draw(!model.isTrash && !model.isFiltered);
    drawList();
  }

  function drawHead() {
    const { listing, isTrash } = model;
    const shown = isTrash ? listing.trash : model.isFiltered ? listing.found : listing.all;
    const told = shown ? `${counted(shown.count, 'recording')}${model.isFiltered && !isTrash ? ` of ${listing.all?.count ?? 0}` : ''}, ${sizeWords(shown.bytes)}` : '';
    setWords(count, isTrash ? `Trash: ${told}` : told);
    setWords(free, listing.free_bytes === null || listing.free_bytes === undefined ? '' : `${sizeWords(listing.free_bytes)} free`);
    setWords(state, stateWords());
    setAttribute(state, 'data-bad', model.problem !== null || store.isSilent);
    show(find, !isTrash && ((listing.all?.count ?? 0) > FEW || model.isFiltered));
    drawOptions();
    show(older, model.next !== null);
    show(trash, !isTrash && (listing.trash?.count ?? 0) > 0);
    if (listing.trash) setWords(/** @type {HTMLElement} */ (trash.lastElementChild), `Trash: ${counted(listing.trash.count, 'recording')}, ${sizeWords(listing.trash.bytes)}`);
    show(back, isTrash);
    show(clear, isTrash && model.rows.length > 0);
  }

  function stateWords() {
    if (store.isSilent) return `The server does not answer: nothing can be opened.${model.at_ms === null ? '' : ` This was the list at ${timeOfDay(model.at_ms)}.`}`;
    if (model.problem !== null) return model.problem;
    return model.at_ms === null ? 'The recordings are being fetched from the server.' : '';
  }

  function drawOptions() {
    const { vehicles = [], tags = [] } = model.listing;
    const key = JSON.stringify([vehicles, tags]);
    if (key === options) return;
    options = key;
    const was = select.value || 'all';
    const option = (/** @type {string} */ value, /** @type {string} */ label) => html('option', { value }, label);
    select.replaceChildren(option('all', 'All'), html('optgroup', { label: 'Time' }, option('days:1', 'Today'), option('days:7', 'Last 7 days'), option('days:30', 'Last 30 days')),
      ...(vehicles.length > 1 ? [html('optgroup', { label: 'Vehicle' }, ...vehicles.map((name) => option(`vehicle:${name}`, name)))] : []),
      ...(tags.length ? [html('optgroup', { label: 'Tag' }, ...tags.map((tag) => option(`tag:${tag}`, tag)))] : []));
    select.value = was;
    if (select.selectedIndex < 0) {
      select.value = 'all';
      if (model.choice.kind !== 'all') model.want({ choice: choiceOf('all') });
    }
  }

  function drawList() {
    const now_ms = Date.now();
    const today = new Date(now_ms).toDateString();
    /** @type {typeof drawn} */
    const next = new Map();
    for (const row of model.rows) {
      const key = JSON.stringify([row, today]);
      const old = drawn.get(row.id);
      next.set(row.id, old && old.key === key ? old : { key, element: drawRow(row, now_ms, (one, from) => {
        from.focus({ preventScroll: true }); // where the sheet gives the focus back to
        sheet.open(one);
      }) });
    }
    const elements = [...next.values()].map(({ element }) => element);
    if (elements.length !== list.children.length || elements.some((element, i) => list.children[i] !== element)) {
      const focused = /** @type {HTMLElement | null} */ (document.activeElement?.closest('.file'))?.dataset['id'];
      list.replaceChildren(...elements);
      if (focused !== undefined && !list.contains(document.activeElement)) next.get(focused)?.element.querySelector('button')?.focus({ preventScroll: true });
    }
    drawn = next;
    const isEmpty = model.rows.length === 0 && model.at_ms !== null && model.problem === null;
    show(empty, isEmpty);
    if (!isEmpty) return;
    setText(emptyTitle, model.isTrash ? 'The trash is empty' : model.isFiltered ? 'Nothing found' : 'No recordings yet');
    emptyWords.replaceChildren(...words(model.isTrash ? 'Deleted recordings are kept here until the trash is emptied.' : model.isFiltered ? 'No name, note or tag matches.' : 'A drive is recorded while the car is monitored. It appears here when it ends.'));
  }

  /** @param {boolean} isTrash */
  function turnTo(isTrash) {
    panel.scrollTop = 0;
    model.want({ isTrash });
    draw();
    (isTrash ? back : trash).focus({ preventScroll: true });
  }

  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let typing;
  const stops = [
    store.on('draw', () => {
      if (!isShown()) return;
      look();
      live.draw(!model.isTrash && !model.isFiltered);
      if (store.isSilent || state.textContent) drawHead();
    }),
    listen(search, 'input', () => {
      clearTimeout(typing);
      typing = setTimeout(() => model.want({ text: search.value }), 200);
    }),
    listen(select, 'change', () => model.want({ choice: choiceOf(select.value) })),
    listen(older, 'click', () => model.more()),
    listen(trash, 'click', () => turnTo(true)),
    listen(back, 'click', () => turnTo(false)),
    listen(clear, 'click', () => sheet.askEmpty(model.listing.trash ?? { count: model.rows.length, bytes: 0 })),
    listen(window, 'catgraph-units', () => draw()),
  ];

  draw();
  look();
  return {
    /** The tab came in front. */
    look: () => {
      asked_ms = -Infinity;
      look();
      draw();
    },
    stop: () => {
      clearTimeout(typing);
      for (const stop of stops) stop();
      live.stop();
      sheet.stop();
      panel.replaceChildren();
    },
  };
}
