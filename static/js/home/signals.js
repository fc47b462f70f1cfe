// Signals: every signal with its value, rate and age; one press shows where it comes from and what was wrong with it.

import { html, icon, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { isAbsent, write } from '../core/ink.js';
import { shownIn, speedWords } from '../core/units.js';
import { age, bearing, counted, fixed, NOTHING, signed } from '../core/format.js';
import { steeringWords } from './pedals.js';
import { CandidateFeed, SignalMore } from './signal-more.js';

/** @typedef {import('../core/protocol-types.js').SignalState<any>} Signal */

const LEVELS = ['OK', 'WARN', 'ERROR', 'STALE'];

/** The headline of each signal's value, as a number with its unit or as text. */
const HEADLINES = /** @type {Record<string, (value: any) => [string, string]>} */ ({
  speed: (value) => speedWords(value.speed_mps),
  acceleration: (value) => [signed(value.acceleration_mps2), 'm/s²'],
  brake: (value) => [fixed(value.percent), '%'],
  accelerator: (value) => [fixed(value.percent), '%'],
  steering: ({ percent }) => (typeof percent === 'number' ? [fixed(Math.abs(percent)), steeringWords(percent).side] : [NOTHING, '%']),
  distance: (value) => (value.none_in_range ? ['none', ''] : [fixed(value.distance_m), 'm']),
  bearing: (value) => {
    const where = bearing(value.bearing_rad);
    return where ? [where.degrees, where.side] : [NOTHING, ''];
  },
  position: (value) => (value.status < 0 ? ['no', 'fix'] : [value.alt_m === null ? '2D' : '3D', 'fix']),
  odometry: (value) => speedWords(value.speed_mps, 2),
  heading: (value) => [value.heading_deg === null ? NOTHING : `${fixed(value.heading_deg, 0)}°`, ''],
  scan: (value) => [fixed(value.beams, 0), 'beams'],
  diagnostics: (value) => [LEVELS[value.worst] ?? NOTHING, ''],
  command: (value) => speedWords(value.speed_mps),
});

/**
 * @param {string} name
 * @param {Record<string, any> | null} value
 * @param {string} [ofSignal] its unit, where the value does not name one
 * @returns {[string, string]}
 */
export function headline(name, value, ofSignal = '') {
  if (!value) return [NOTHING, ''];
  if (HEADLINES[name]) return HEADLINES[name](value);
  const number = value.percent ?? value.value;
  return [fixed(typeof number === 'number' ? number : null), String(value.unit ?? (value.percent === undefined ? ofSignal : '%'))];
}

/**
 * What a press shows: where it comes from, how much came, what was wrong with it.
 * @param {Signal} signal
 * @param {string} name
 * @returns {[string, string][]}
 */
export function details(signal, name) {
  const rows = /** @type {[string, string | null | undefined][]} */ ([
    ['Topic', signal.topic ?? (signal.value ? 'no own stamp' : 'no known topic')],
    ['Type', signal.type],
    ['Why this', signal.why],
    ['Frame', signal.frame ?? (name === 'scan' ? signal.value?.['frame_id'] : null)],
    ['Shown in', signal.unit],
    ['Note', signal.note],
    ['Messages', signal.topic ? String(signal.count) : null],
    ['Rejected', signal.rejected ? `${signal.rejected}: ${signal.rejected_why ?? 'no reason given'}` : signal.count ? '0' : null],
    ['Repaired', signal.repaired ? `${signal.repaired}: ${signal.repaired_why ?? ''}` : null],
    ['Expected', signal.expected_hz ? `${fixed(signal.expected_hz)} Hz` : null],
    ['Stale after', signal.horizon_s ? `${fixed(signal.horizon_s)} s` : null],
    ['Range so far', rangeWords(signal)],
    ['Derived from', typeof signal.value?.['source'] === 'string' && signal.value['source'] !== 'topic' ? signal.value['source'] : null],
    ['Usable beams', name === 'scan' && signal.value ? `${signal.value['usable']} of ${signal.value['beams']}` : null],
    ['Components', name === 'diagnostics' ? componentWords(signal.value?.['components']) : null],
  ]);
  return rows.flatMap(([key, text]) => (text === null || text === undefined || text === '' ? [] : [[key, text]]));
}

/** Its lowest and highest value since connecting. @param {Signal} signal */
function rangeWords({ lowest, highest, unit = '' }) {
  if (lowest === null || highest === null) return null;
  const [low, high] = [shownIn(lowest, unit), shownIn(highest, unit)];
  return `${fixed(low.value, 2)} to ${fixed(high.value, 2)} ${low.unit}`.trim();
}

/** Where a signal comes from, in short. @param {Signal} signal @param {import('../core/freshness.js').Ink} [ink] */
export function kindWords({ type, topic, value }, ink = 'fresh') {
  if (ink === 'not_chosen') return 'press to choose';
  const source = value?.['source'];
  if (typeof source === 'string' && source !== 'topic') return `from ${source}`; // also where the topic's messages hold no value
  if (type) return type.split('/').at(-1) ?? type;
  return topic ? 'type unknown' : 'no such topic';
}

/** @param {any} components */
function componentWords(components) {
  if (!Array.isArray(components)) return null;
  return components.map(({ name, level, message }) => `${LEVELS[level] ?? level} ${name}: ${message}`).join('\n');
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {{say: (sentence: string, title?: string) => void, of?: string}} where `of`: the signal that is open at first
 */
export function mount(root, store, { say, of }) {
  const summary = html('p', { class: 'note-line' });
  const table = html('div', { class: 'sigs' });
  root.replaceChildren(html('div', { class: 'sig h' }, ...['Signal', 'Value', 'Hz', 'Age, s'].map((label) => html('span', {}, label))), table, summary);
  const feed = new CandidateFeed(store);
  /** @type {Map<string, ReturnType<typeof row>>} */
  const rows = new Map();

  function draw() {
    const { frame } = store;
    if (!frame) return;
    for (const [name, signal] of Object.entries(frame.signals)) {
      let found = rows.get(name);
      if (!found) {
        found = row(new SignalMore(store, name, say, feed), draw);
        rows.set(name, found);
        table.append(found.element, found.more.element);
        if (name === of) open(found);
      }
      fill(found, name, signal, store.ink(name));
    }
    setSentence(summary, summaryWords(store, frame));
  }

  draw();
  const stop = store.on('draw', draw);
  if (of) rows.get(of)?.element.scrollIntoView({ block: 'start' });
  return () => {
    stop();
    root.replaceChildren();
  };
}

/** @param {import('../core/store.js').Store} store @param {import('../core/protocol-types.js').State} frame */
function summaryWords(store, { signals, session, link, server }) {
  const isNone = Object.values(signals).every(({ count }) => count === 0);
  const parts = [
    isNone ? 'No signal has arrived yet. A row fills with the first message of its topic; press a row to choose its topic.' : '',
    `${session.received} messages received, ${session.rejected} rejected.`,
    link.unreadable_frames ? `${counted(link.unreadable_frames, 'frame')} from the bridge unreadable: ${link.unreadable_why ?? ''}.` : '',
    server.frames_skipped ? `${counted(server.frames_skipped, 'frame')} skipped for pages that were slower than the car.` : '',
    store.unreadable ? `${counted(store.unreadable, 'frame')} from the server unreadable here.` : '',
  ];
  return parts.filter(Boolean).join(' ');
}

/** @param {SignalMore} more @param {() => void} draw */
function row(more, draw) {
  const name = html('span');
  const kind = html('small');
  const value = html('span', { class: 'n' });
  const unit = html('span', { class: 'u' });
  const rate = html('span', { class: 'n' });
  const old = html('span', { class: 'n' });
  const clock = icon('clock', 's');
  const element = html('button', { type: 'button', class: 'sig', 'aria-expanded': 'false' }, html('span', {}, name, kind), html('span', {}, value, unit), rate,
    html('span', { class: 'mini' }, clock, old));
  const found = { element, more, name, kind, value, unit, rate, old, clock };
  element.addEventListener('click', () => {
    open(found, !more.isOpen);
    draw();
    element.scrollIntoView({ block: 'nearest' }); // a stale one leaves the top of the list as it opens
  });
  return found;
}

/** @param {{element: HTMLElement, more: SignalMore}} row @param {boolean} [isOpen] */
function open({ element, more }, isOpen = true) {
  show(more.element, isOpen);
  setAttribute(element, 'aria-expanded', String(isOpen));
}

/**
 * @param {ReturnType<typeof row>} at
 * @param {string} name
 * @param {Signal} signal
 * @param {{ink: import('../core/freshness.js').Ink, age_s: number | null}} state
 */
function fill(at, name, signal, { ink, age_s }) {
  const [text, unit] = headline(name, signal.value, signal.unit);
  setText(at.name, signal.label);
  setText(at.kind, kindWords(signal, ink));
  setAttribute(at.element, 'data-faulty', signal.rejected > 0);
  write(at.value, ink, text, at.unit, unit);
  setText(at.rate, ink === 'stale' ? '' : ['never', 'not_published', 'not_chosen'].includes(ink) ? NOTHING : fixed(signal.rate_hz)); // its place is the age's
  setSentence(at.old, isAbsent(ink) ? NOTHING : `${ink === 'stale' ? 'STALE ' : ''}${age(age_s, 2)}`);
  setAttribute(at.old, 'data-age', ink);
  show(at.clock, ink === 'ageing');
  if (at.more.isOpen) at.more.draw(details(signal, name));
}
