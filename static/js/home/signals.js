// Signals: every signal with its value, rate and age; one press shows where it comes from and what was wrong with it.

import { html, icon, setAttribute, setText, setWords, show } from '../core/dom.js';
import { isAbsent, write } from '../core/ink.js';
import { shownIn, speedWords } from '../core/units.js';
import { age, counted, fixed, NOTHING } from '../core/format.js';

/** @typedef {import('../core/protocol-types.js').SignalState<any>} Signal */

const LEVELS = ['OK', 'WARN', 'ERROR', 'STALE'];

/** The headline of each signal's value, as a number with its unit or as a word. */
const HEADLINES = /** @type {Record<string, (value: any) => [string, string]>} */ ({
  speed: (value) => speedWords(value.speed_mps),
  acceleration: (value) => [fixed(value.acceleration_mps2), 'm/s²'],
  brake: (value) => [fixed(value.percent), '%'],
  accelerator: (value) => [fixed(value.percent), '%'],
  steering: (value) => [fixed(value.percent), '%'],
  distance: (value) => (value.none_in_range ? ['none', ''] : [fixed(value.distance_m), 'm']),
  bearing: (value) => [fixed(value.bearing_rad, 3), ''],
  position: (value) => (value.status < 0 ? ['no', 'fix'] : [value.alt_m === null ? '2D' : '3D', 'fix']),
  odometry: (value) => speedWords(value.speed_mps, 2),
  heading: (value) => [value.heading_deg === null ? NOTHING : `${fixed(value.heading_deg, 0)}°`, ''],
  scan: (value) => [fixed(value.beams, 0), ''],
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
    ['Note', signal.note],
    ['Messages', signal.topic ? String(signal.count) : null],
    ['Rejected', signal.rejected ? `${signal.rejected}: ${signal.rejected_why ?? 'no reason given'}` : signal.count ? '0' : null],
    ['Repaired', signal.repaired ? `${signal.repaired}: ${signal.repaired_why ?? ''}` : null],
    ['Expected', signal.expected_hz ? `${fixed(signal.expected_hz)} Hz` : null],
    ['Stale after', signal.horizon_s ? `${fixed(signal.horizon_s)} s` : null],
    ['Range so far', rangeWords(signal)],
    ['Derived from', typeof signal.value?.['source'] === 'string' && signal.value['source'] !== 'topic' ? signal.value['source'] : null],
    ['Frame', name === 'scan' ? signal.value?.['frame_id'] : null],
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

/** Where a signal comes from, in a word. @param {Signal} signal */
export function kindWords({ type, topic, value }) {
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
 */
export function mount(root, store) {
  const summary = html('p', { class: 'note-line' });
  const table = html('div', { class: 'sigs' });
  root.replaceChildren(html('div', { class: 'sig h' }, ...['Signal', 'Value', 'Hz', 'Age, s'].map((word) => html('span', {}, word))), table, summary);
  /** @type {Map<string, ReturnType<typeof row>>} */
  const rows = new Map();

  function draw() {
    const { frame } = store;
    if (!frame) return;
    for (const [name, signal] of Object.entries(frame.signals)) {
      let found = rows.get(name);
      if (!found) {
        found = row(() => pick(store, name));
        rows.set(name, found);
        table.append(found.element, found.more);
      }
      fill(found, name, signal, store.ink(name));
    }
    const { session, link, server } = frame;
    const isNone = Object.values(frame.signals).every(({ count }) => count === 0);
    const parts = [
      isNone ? 'No signal has arrived yet. A row fills with the first message of its topic; press a row to choose its topic.' : '',
      `${session.received} messages received, ${session.rejected} rejected.`,
      link.unreadable_frames ? `${counted(link.unreadable_frames, 'frame')} from the bridge unreadable: ${link.unreadable_why ?? ''}.` : '',
      server.frames_skipped ? `${counted(server.frames_skipped, 'frame')} skipped for pages that were slower than the car.` : '',
      store.unreadable ? `${counted(store.unreadable, 'frame')} from the server unreadable here.` : '',
    ];
    setWords(summary, parts.filter(Boolean).join(' '));
  }

  draw();
  const stop = store.on('draw', draw);
  return () => {
    stop();
    root.replaceChildren();
  };
}

/** @param {() => void} choose */
function row(choose) {
  const name = html('span');
  const kind = html('small');
  const value = html('span', { class: 'n' });
  const unit = html('span', { class: 'u' });
  const rate = html('span', { class: 'n' });
  const old = html('span', { class: 'n' });
  const clock = icon('clock', 's');
  const element = html('button', { type: 'button', class: 'sig', 'aria-expanded': 'false' }, html('span', {}, name, kind), html('span', {}, value, unit), rate,
    html('span', { class: 'mini' }, clock, old));
  const more = html('dl', { class: 'sig-more', hidden: true });
  const choice = html('button', { type: 'button', class: 'key wide' }, 'Choose another topic');
  choice.addEventListener('click', choose);
  element.addEventListener('click', () => {
    show(more, more.hasAttribute('hidden'));
    setAttribute(element, 'aria-expanded', String(!more.hasAttribute('hidden')));
  });
  return { element, more, choice, name, kind, value, unit, rate, old, clock };
}

/**
 * @param {ReturnType<typeof row>} at
 * @param {string} name
 * @param {Signal} signal
 * @param {{ink: import('../core/protocol-types.js').SignalFreshness, age_s: number | null}} state
 */
function fill(at, name, signal, { ink, age_s }) {
  const [text, unit] = headline(name, signal.value, signal.unit);
  setText(at.name, signal.label);
  setText(at.kind, kindWords(signal));
  setAttribute(at.element, 'data-faulty', signal.rejected > 0);
  write(at.value, ink, text, at.unit, unit);
  setText(at.rate, ink === 'never' || ink === 'not_published' ? NOTHING : fixed(signal.rate_hz));
  setText(at.old, isAbsent(ink) ? NOTHING : age(age_s, 2));
  setAttribute(at.old, 'data-age', ink);
  show(at.clock, ink === 'ageing');
  if (at.more.hasAttribute('hidden')) return;
  const key = JSON.stringify(details(signal, name));
  if (at.more.dataset['key'] === key) return;
  at.more.replaceChildren(...details(signal, name).flatMap(([term, text]) => {
    const description = html('dd');
    setWords(description, text);
    return [html('dt', {}, term), description];
  }), html('dt', {}, 'Choice'), html('dd', {}, at.choice));
  at.more.dataset['key'] = key;
}

/**
 * Lets another topic be picked; what that takes is loaded now.
 * @param {import('../core/store.js').Store} store
 * @param {string} name
 */
async function pick(store, name) {
  try {
    const [{ openTopicPicker }, { settingsOf }] = await Promise.all([import('../settings/topic-picker.js'), import('../settings/settings-model.js')]);
    const model = settingsOf(store);
    model.look();
    await openTopicPicker(store, model, name);
  } catch {
    console.warn('The list of topics could not be loaded: the server does not answer.');
  }
}
