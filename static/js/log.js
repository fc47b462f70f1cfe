// The alarm log: what stands and who has seen it, then what happened, newest first, with the times in which this page was blind.

import { gapWords } from './events.js';
import { html, icon, setText, setWords, show, words } from './dom.js';
import { byUrgency } from './alarm-layout.js';
import { loadWords, standingWords } from './standing.js';
import { timeOfDay } from './words.js';

/**
 * @typedef {import('./events.js').Row} Row
 * @typedef {import('./protocol.js').AlarmEvent} AlarmEvent
 */

const MARKS = { critical: ['crit', 'c-crit'], warning: ['warn', 'c-warn'], advisory: ['info', ''] };
const CHANGES = /** @type {Record<string, string>} */ ({
  raised: '', recaused: 'again', cleared: 'cleared', acknowledged: 'acknowledged', shelved: 'shelved', unshelved: 'no longer shelved',
  suppressed: 'not announced', unsuppressed: 'announced again',
});

/**
 * How one event reads.
 * @param {AlarmEvent} event
 */
export function eventWords(event) {
  if (event.alarm === null) return { icon: event.change === 'lost' ? 'link-off' : 'info', kind: '', title: event.text || event.change, text: '' };
  const change = CHANGES[event.change] ?? event.change;
  const isRise = event.change === 'raised' || event.change === 'recaused' || event.change === 'unsuppressed';
  const [mark, kind] = isRise ? MARKS[event.priority ?? 'advisory'] : ['ok', ''];
  return {
    icon: mark ?? 'info', kind: kind ?? '', title: `${event.title ?? event.alarm} ${change}`.trim(),
    text: [event.text, event.by ? `by ${event.by}` : ''].filter(Boolean).join(' · '),
  };
}

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 */
export function mount(root, store) {
  const standing = html('span', { class: 'n v' });
  const shelved = html('span', { class: 'n v' });
  const number = html('span');
  const list = html('ul', { class: 'log', 'data-f': 'happened' });
  const now = html('ul', { class: 'log', 'data-f': 'standing' });
  const load = html('span', { 'data-f': 'load' });
  const trouble = html('p', { class: 'sec', 'data-f': 'trouble', role: 'status' });
  const three = (/** @type {string} */ label, /** @type {HTMLElement} */ value) => html('div', {}, html('span', { class: 'lab' }, label), html('br'), value);
  root.replaceChildren(html('section', { class: 'three two' }, three('Standing', standing), three('Shelved', shelved)),
    trouble, now, html('div', { class: 'sec' }, load), html('div', { class: 'sec' }, html('span', {}, 'Newest first'), number), list);
  let drawn = -1;
  let stood = '';

  function draw() {
    const alarms = store.frame?.alarms ?? [];
    setText(standing, String(alarms.filter((alarm) => alarm.state !== 'SHELVED').length));
    setText(shelved, String(alarms.filter((alarm) => alarm.state === 'SHELVED').length));
    setWords(load, loadWords(store.frame?.alarm_load));
    setWords(trouble, store.frame?.log_trouble ?? '');
    show(trouble, Boolean(store.frame?.log_trouble));
    const lines = byUrgency(alarms).map((alarm) => [alarm.title, standingWords(alarm), timeOfDay(alarm.raised_ms), alarm.priority]);
    const standingKey = JSON.stringify(lines);
    if (standingKey !== stood) {
      stood = standingKey;
      now.replaceChildren(...lines.map(standingRow));
    }
    const { rows, last } = store.log;
    const key = rows.length * 1e6 + (last ?? 0);
    if (key === drawn) return;
    drawn = key;
    number.replaceChildren('No. ', html('span', { class: 'n' }, String(last ?? 0)));
    list.replaceChildren(...(rows.length ? rows.map(row) : [html('li', {}, html('span'), html('span', { class: 't' }, 'Nothing has happened yet'))]));
  }

  draw();
  const stop = store.on('draw', draw);
  return () => {
    stop();
    root.replaceChildren();
  };
}

/** @param {string[]} line title, words, time of day, priority */
function standingRow([title = '', text = '', at = '', priority = '']) {
  const [mark, kind] = MARKS[/** @type {keyof typeof MARKS} */ (priority)] ?? ['info', ''];
  return html('li', {}, icon(mark ?? 'info', kind ?? ''), html('span', { class: 't' }, ...words(title)), html('span', { class: 'n h' }, at),
    html('span', { class: 'm' }, ...words(text)));
}

/** @param {Row} entry */
function row({ event, gap }) {
  if (!event) {
    return html('li', { class: 'gap hatched' }, html('span'), html('span', { class: 'tag' }, icon('link-off', 's'), ...words(gapWords(gap))));
  }
  const { icon: glyph, kind, title, text } = eventWords(event);
  return html('li', {}, icon(glyph, kind), html('span', { class: 't' }, ...words(title)), html('span', { class: 'n h' }, timeOfDay(event.at_ms)),
    html('span', { class: 'm' }, ...words(text)));
}
