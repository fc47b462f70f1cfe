// The alarm log: what stands and who has seen it, then what happened, newest first, with the times in which this page was blind.

import { MARKS, KINDS, asked, dayWords, eventWords, joined, lowest, tookWords } from './log-layout.js';
import { gapWords } from '../core/event-log.js';
import { html, icon, listen, setAttribute, setText, setWords, show, words } from '../core/dom.js';
import { byUrgency } from './alarm-layout.js';
import { loadWords, standingWords } from './standing.js';
import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/event-log.js').Row} Row
 * @typedef {import('../core/protocol.js').AlarmEvent} AlarmEvent
 */

const PAGE = 100; // events a request

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const [inTen, standing, shelved] = [html('span', { class: 'n v' }), html('span', { class: 'n v' }), html('span', { class: 'n v' })];
  const number = html('span');
  const list = html('ul', { class: 'log', 'data-f': 'happened' });
  const now = html('ul', { class: 'log', 'data-f': 'standing' });
  const load = html('p', { class: 'sec', 'data-f': 'load' });
  const trouble = html('p', { class: 'sec', 'data-f': 'trouble', role: 'status' });
  const three = (/** @type {string} */ label, /** @type {HTMLElement} */ value) => html('div', {}, html('span', { class: 'lab' }, label), html('br'), value);
  const kinds = html('div', { class: 'seg kinds', role: 'group', 'aria-label': 'Which events' },
    ...KINDS.map(([kind, label]) => html('button', { type: 'button', 'data-kind': kind, 'aria-pressed': 'false' }, label)));
  const find = /** @type {HTMLInputElement} */ (html('input', { type: 'search', id: 'log-find', maxlength: 100, enterkeyhint: 'search', autocomplete: 'off', placeholder: 'Find in the log', 'aria-label': 'Find in the log' }));
  const [csv, json] = [html('a', { class: 'key', download: '' }, icon('download'), 'CSV'), html('a', { class: 'key', download: '' }, icon('download'), 'JSON')];
  const older = html('button', { type: 'button', class: 'key wide', 'data-f': 'older' }, 'Older');
  const said = html('p', { class: 'note-line', role: 'status', 'data-f': 'log-says' });
  root.replaceChildren(
    html('section', { class: 'three' }, three('In 10 min', inTen), three('Standing', standing), three('Shelved', shelved)), load, trouble, now,
    html('div', { class: 'log-tools' }, kinds, html('div', { class: 'field' }, icon('find'), find), html('div', { class: 'pair' }, csv, json)),
    html('div', { class: 'sec' }, html('span', {}, 'Newest first'), number), list, said, html('div', { class: 'keys' }, older));

  /** @type {import('./log-layout.js').Filter} */
  let filter = { kind: 'all', text: '' };
  /** @type {{events: AlarmEvent[], next: number | null | undefined}} undefined: not asked yet */
  let past = { events: [], next: undefined };
  let turn = 0; // of the filter: an answer to an older question is dropped
  let isAsking = false;
  let drawn = '';
  let stood = '';

  const stops = [
    store.on('draw', draw),
    listen(kinds, 'click', (event) => {
      const kind = /** @type {HTMLElement | null} */ (event.target.closest('[data-kind]'))?.dataset['kind'];
      if (kind) choose({ ...filter, kind: /** @type {any} */ (kind) });
    }),
    listen(find, 'input', () => choose({ ...filter, text: find.value })),
    listen(older, 'click', fetchOlder),
  ];

  /** @param {import('./log-layout.js').Filter} wanted */
  function choose(wanted) {
    filter = wanted;
    past = { events: [], next: undefined };
    turn += 1;
    isAsking = false;
    setText(said, '');
    for (const button of kinds.querySelectorAll('button')) setAttribute(button, 'aria-pressed', String(button.dataset['kind'] === filter.kind));
    const vehicle = document.documentElement.dataset['vehicle'];
    for (const [link, form] of /** @type {const} */ ([[csv, 'csv'], [json, 'json']])) {
      link.setAttribute('href', `/api/log.${form}?${new URLSearchParams({ ...(vehicle ? { vehicle } : {}), ...asked(filter) })}`);
      link.setAttribute('aria-label', `Save ${filter.kind === 'all' && !filter.text.trim() ? 'the whole log' : 'what is found'} as ${form.toUpperCase()}`);
    }
    draw();
  }

  async function fetchOlder() {
    if (isAsking) return;
    const mine = turn;
    isAsking = true;
    setAttribute(older, 'data-busy', true);
    const before = past.next ?? lowest(store.log.rows);
    const vehicle = document.documentElement.dataset['vehicle'];
    const query = new URLSearchParams({ ...(vehicle ? { vehicle } : {}), limit: String(PAGE), ...(before === null ? {} : { before: String(before) }), ...asked(filter) });
    try {
      const answer = await fetch(`/api/log?${query}`, { cache: 'no-store' });
      if (!answer.ok) throw new Error(String(answer.status));
      const { events, next_before } = await answer.json();
      if (mine !== turn) return;
      past = { events: [...past.events, ...events], next: next_before };
      setText(said, next_before === null ? 'This is the beginning of the log.' : events.length ? '' : 'Nothing among the last 2000 events; older ones may fit.');
    } catch {
      if (mine === turn) setText(said, 'The server did not give older events. Try again.');
    } finally {
      if (mine === turn) {
        isAsking = false;
        setAttribute(older, 'data-busy', null);
        draw();
      }
    }
  }

  function draw() {
    const alarms = store.frame?.alarms ?? [];
    setText(inTen, String(store.frame?.alarm_load?.in_10_min ?? '–'));
    setText(standing, String(alarms.filter((alarm) => alarm.state !== 'SHELVED').length));
    setText(shelved, String(alarms.filter((alarm) => alarm.state === 'SHELVED').length));
    setWords(load, loadWords(store.frame?.alarm_load));
    setWords(trouble, store.frame?.log_trouble ?? '');
    show(trouble, Boolean(store.frame?.log_trouble));
    const lines = byUrgency(alarms).map((alarm) => [alarm.title, standingWords(alarm), timeOfDay(alarm.raised_ms), alarm.priority]);
    const standingKey = JSON.stringify(lines);
    if (standingKey !== stood) {
      now.replaceChildren(...lines.map(standingRow));
      stood = standingKey;
    }
    const { rows, last } = store.log;
    setAttribute(older, 'hidden', past.next === null || (past.next === undefined && (lowest(rows) ?? 2) <= 1));
    const today = new Date(Date.now()).toDateString(); // at midnight "Today" is another day
    const key = JSON.stringify([rows.length, last, past.events.length, filter, today]);
    if (key === drawn) return;
    number.replaceChildren('No. ', html('span', { class: 'n' }, String(last ?? 0)));
    const all = joined(rows, past.events, filter);
    list.replaceChildren(...(all.length ? all.flatMap((one, i) => withDay(one, all[i - 1], all)) : [html('li', { class: 'none' }, html('span'), html('span', { class: 't' }, filter.kind === 'all' && !filter.text.trim() ? 'Nothing has happened yet' : 'Nothing found here'))]));
    drawn = key;
  }

  choose(filter);
  return () => {
    turn += 1;
    stops.forEach((stop) => stop());
    root.replaceChildren();
  };
}

/** @param {string[]} line title, words, time of day, priority */
function standingRow([title = '', text = '', at = '', priority = '']) {
  const [mark, kind] = MARKS[/** @type {keyof typeof MARKS} */ (priority)] ?? ['info', ''];
  return html('li', {}, icon(mark ?? 'info', kind ?? ''), html('span', { class: 't' }, ...words(title)), html('span', { class: 'n h' }, at),
    html('span', { class: 'm' }, ...words(text)));
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
    return html('li', { class: 'gap hatched' }, html('span'), html('span', { class: 'tag' }, icon('link-off', 's'), ...words(gapWords(gap))));
  }
  const { icon: glyph, kind, title, text } = eventWords(event);
  const told = [text, tookWords(event, all)].filter(Boolean).join(' · ');
  return html('li', {}, icon(glyph, kind), html('span', { class: 't' }, ...words(title)), html('span', { class: 'n h' }, timeOfDay(event.at_ms)),
    html('span', { class: 'm' }, ...words(told)));
}
