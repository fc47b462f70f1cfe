// The alarm log: what stands and who has seen it, then what happened, newest first, with the times in which this page was blind.

import { MARKS, KINDS, dayWords, eventWords, gapLine, joined, lowest, standingRows, tookWords } from './log-layout.js';
import { html, icon, listen, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { OlderEvents, queryOf } from './older-events.js';
import { loadWords } from './standing.js';
import { timeOfDay } from '../core/format.js';

/** @typedef {import('../core/event-log.js').Row} Row */

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const log = new AlarmLog(root, store);
  const { kinds, find, older } = log.parts;
  const stops = [
    store.on('draw', () => log.draw()),
    listen(kinds, 'click', (event) => {
      const kind = /** @type {HTMLElement | null} */ (event.target.closest('[data-kind]'))?.dataset['kind'];
      if (kind) log.choose({ kind: /** @type {any} */ (kind) });
    }),
    listen(find, 'input', () => log.choose({ text: find.value })),
    listen(older, 'click', () => void log.older.fetch(log.filter, store.log.rows)),
  ];
  return () => {
    log.older.clear();
    stops.forEach((stop) => stop());
    root.replaceChildren();
  };
}

class AlarmLog {
  /** @type {import('./log-layout.js').Filter} */
  filter = { kind: 'all', text: '' };
  #happened = '';
  #standing = '';

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.store = store;
    this.parts = build(root);
    this.older = new OlderEvents(() => this.draw());
    this.choose({});
  }

  get isAll() {
    return this.filter.kind === 'all' && !this.filter.text.trim();
  }

  /** @param {Partial<import('./log-layout.js').Filter>} change */
  choose(change) {
    const { kinds, csv, json } = this.parts;
    this.filter = { ...this.filter, ...change };
    this.older.clear();
    for (const button of kinds.querySelectorAll('button')) setAttribute(button, 'aria-pressed', String(button.dataset['kind'] === this.filter.kind));
    for (const [link, form] of /** @type {const} */ ([[csv, 'csv'], [json, 'json']])) {
      link.setAttribute('href', `/api/log.${form}?${queryOf(this.filter)}`);
      link.setAttribute('aria-label', `Save ${this.isAll ? 'the whole log' : 'what is found'} as ${form.toUpperCase()}`);
    }
    this.draw();
  }

  draw() {
    const { frame } = this.store;
    const { inTen, standing, shelved, load, trouble, now } = this.parts;
    const alarms = frame?.alarms ?? [];
    setText(inTen, String(frame?.alarm_load?.in_10_min ?? '–'));
    setText(standing, String(alarms.filter((alarm) => alarm.state !== 'SHELVED').length));
    setText(shelved, String(alarms.filter((alarm) => alarm.state === 'SHELVED').length));
    setSentence(load, loadWords(frame?.alarm_load));
    const why = frame?.replay ? 'These are the events of the live car. Those of the recording are in the list of its alarms.' : frame?.log_trouble ?? '';
    setSentence(trouble, why);
    show(trouble, why !== '');
    const lines = standingRows(alarms, frame?.suppressed ?? []);
    const key = JSON.stringify(lines);
    if (key !== this.#standing) {
      now.replaceChildren(...lines.map(standingRow));
      this.#standing = key;
    }
    this.#drawEvents();
  }

  #drawEvents() {
    const { list, note, older } = this.parts;
    const { rows, last } = this.store.log;
    const { events, next } = this.older;
    setText(note, this.older.note);
    setAttribute(older, 'data-busy', this.older.isBusy || null);
    setAttribute(older, 'hidden', next === null || (next === undefined && (lowest(rows) ?? 2) <= 1));
    const today = new Date(Date.now()).toDateString(); // the headings of the days change at midnight
    const key = JSON.stringify([rows.length, last, this.store.log.measured, events.length, this.filter, today]);
    if (key === this.#happened) return;
    const all = joined(rows, events, this.filter);
    list.replaceChildren(...(all.length ? all.flatMap((one, i) => withDay(one, all[i - 1], all))
      : [html('li', { class: 'none' }, html('span'), html('span', { class: 't' }, this.isAll ? 'No events yet. Alarms, acknowledgements, connections and changed settings are listed here.' : 'Nothing found here'))]));
    this.#happened = key;
  }
}

/** @param {'critical' | 'warning' | 'advisory'} kind */
function markOf(kind) {
  const [mark = 'info', colour = ''] = MARKS[kind];
  return icon(mark, colour);
}

/** Builds the parts of the log in `root`. @param {HTMLElement} root */
function build(root) {
  const [inTen, standing, shelved] = [html('span', { class: 'n v' }), html('span', { class: 'n v' }), html('span', { class: 'n v' })];
  const list = html('ul', { class: 'log', 'data-f': 'happened' });
  const now = html('ul', { class: 'log', 'data-f': 'standing' });
  const load = html('p', { class: 'sec', 'data-f': 'load' });
  const trouble = html('p', { class: 'sec', 'data-f': 'trouble', role: 'status' });
  const figure = (/** @type {string} */ label, /** @type {HTMLElement} */ value) => html('div', {}, html('span', { class: 'lab' }, label), html('br'), value);
  const kinds = html('div', { class: 'seg kinds', role: 'group', 'aria-label': 'Which events' },
    ...KINDS.map(([kind, label]) => html('button', { type: 'button', 'data-kind': kind, 'aria-pressed': 'false', 'aria-label': label, title: label },
      kind === 'all' || kind === 'other' ? label : markOf(kind))));  // the marks of the rows: all filters on one line
  const find = /** @type {HTMLInputElement} */ (html('input', { type: 'search', id: 'log-find', maxlength: 100, enterkeyhint: 'search', autocomplete: 'off', placeholder: 'Find', 'aria-label': 'Find in the log' }));
  const [csv, json] = [html('a', { download: '' }, icon('download', 's'), 'CSV'), html('a', { download: '' }, icon('download', 's'), 'JSON')];
  const older = html('button', { type: 'button', class: 'key wide', 'data-f': 'older' }, 'Older');
  const note = html('p', { class: 'note-line', role: 'status', 'data-f': 'log-message' });
  root.replaceChildren(
    html('section', { class: 'three' }, figure('In 10 min', inTen), figure('Active', standing), figure('Shelved', shelved)), load, trouble, now,
    html('div', { class: 'log-tools' }, kinds, html('div', { class: 'field' }, icon('find', 's'), find)),
    html('div', { class: 'sec log-save' }, html('span', {}, 'Newest first'), html('span', {}, csv, json)), list, note, html('div', { class: 'keys' }, older));
  return { inTen, standing, shelved, list, now, load, trouble, kinds, find, csv, json, older, note };
}

/** @param {ReturnType<typeof standingRows>[number]} row */
function standingRow({ icon: mark, colour, title, text, at, kind }) {
  return html('li', { 'data-kind': kind }, icon(mark, colour), html('span', { class: 't' }, ...textNodes(title)), html('span', { class: 'n h' }, at),
    html('span', { class: 'm' }, ...textNodes(text)));
}

/** @param {Row} row */
const moment = ({ event, gap }) => event?.at_ms ?? gap?.at_ms ?? 0;

/**
 * A row, and the name of its day above it where it begins one; today needs none at the top.
 * @param {Row} row
 * @param {Row | undefined} above
 * @param {Row[]} all
 */
function withDay(row, above, all) {
  const now_ms = Date.now();
  const day = dayWords(moment(row), now_ms);
  const before = above ? dayWords(moment(above), now_ms) : 'Today';
  return day === before ? [drawRow(row, all)] : [html('li', { class: 'day' }, day), drawRow(row, all)];
}

/**
 * @param {Row} row
 * @param {Row[]} all
 */
function drawRow({ event, gap }, all) {
  if (!event) {
    return html('li', { class: 'gap hatched' }, html('span'), html('span', { class: 'tag' }, icon('link-off', 's'), ...textNodes(gapLine(gap))));
  }
  const { icon: glyph, kind, title, text } = eventWords(event);
  const details = [text, tookWords(event, all)].filter(Boolean).join(' · ');
  return html('li', {}, icon(glyph, kind), html('span', { class: 't' }, ...textNodes(title)), html('span', { class: 'n h' }, timeOfDay(event.at_ms)),
    html('span', { class: 'm' }, ...textNodes(details)));
}
