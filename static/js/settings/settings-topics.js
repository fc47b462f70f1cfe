// The topics of the signals in Settings: which carries what, how fast, and what is wrong with it; a press lets another be picked.

import { html, icon, setAttribute, setIcon, setText, setSentence, show } from '../core/dom.js';
import { missingWords } from '../files/missing-topics.js';
import { openScreen } from '../core/open-screen.js';
import { found } from './settings-layout.js';
import { openTopicPicker } from './topic-picker.js';
import { age, fixed, NOTHING } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').SignalState<any>} Signal
 * @typedef {{topic: string, detail: string, icon: 'ok' | 'warn' | 'unknown', rate: string}} Shown
 */

/**
 * How a signal's topic reads.
 * @param {Signal} signal
 * @param {string | undefined} picked by the operator
 * @param {boolean} isLive
 * @param {boolean} [isOpen] there is an open question which topic it is
 * @returns {Shown}
 */
export function topicWords(signal, picked, isLive, isOpen = false) {
  const kind = signal.type?.split('/').at(-1);
  const label = signal.label.toLowerCase();
  if (isOpen && !signal.value) return { topic: signal.label, detail: 'not chosen: press to choose', icon: 'warn', rate: NOTHING };
  if (!signal.topic) {
    const source = typeof signal.value?.['source'] === 'string' ? `from ${signal.value['source']}` : 'not published';
    return picked
      ? { topic: picked, detail: `${label} · chosen by you, but not published`, icon: 'warn', rate: NOTHING }
      : { topic: signal.label, detail: signal.value ? source : 'not published', icon: signal.value ? 'ok' : 'unknown', rate: NOTHING };
  }
  if (signal.freshness === 'not_published' && signal.note) {
    const detail = `${label} · ${picked ? `chosen by you, ${signal.note}` : signal.note}`;
    return { topic: signal.topic, detail, icon: picked ? 'warn' : 'unknown', rate: NOTHING };
  }
  const facts = [
    `${label} · ${kind ?? 'type unknown'}${picked ? ' · chosen by you' : ''}`,
    signal.note ?? '',
    signal.rejected ? `${signal.rejected} rejected: ${signal.rejected_why ?? 'no reason given'}` : '',
    signal.freshness === 'never' ? 'no message yet' : signal.freshness === 'stale' ? `silent for ${age(signal.age_s)} s` : '',
  ];
  const isWell = !signal.note && !signal.rejected && (signal.freshness === 'fresh' || signal.freshness === 'ageing');
  return {
    topic: signal.topic, detail: facts.filter(Boolean).join('\n'), icon: !isLive || signal.freshness === 'not_measured' ? 'unknown' : isWell ? 'ok' : 'warn',
    rate: isLive ? fixed(signal.rate_hz) : NOTHING,
  };
}

export class SettingsTopics {
  #query = '';
  /** How many topics carry no signal; null: not known. @type {number | null} */
  #unmapped = null;
  #asked_ms = -Infinity;

  /** @param {import('../core/store.js').Store} store @param {import('./settings-model.js').SettingsModel} model */
  constructor(store, model) {
    this.store = store;
    this.model = model;
    this.count = html('span');
    this.list = html('ul', { class: 'topics' });
    this.missing = html('p', { class: 'm', 'data-f': 'topics-missing', hidden: true });
    this.signals = html('button', { type: 'button', class: 'key wide', 'data-f': 'open-signals' }, icon('link'), 'Signals: source, frame, unit');
    this.signals.addEventListener('click', () => openScreen('signals'));
    this.element = html('section', { 'aria-label': 'Topics' }, html('div', { class: 'sec' }, html('span', {}, 'Topics'), this.count), this.list, this.missing, html('div', { class: 'keys' }, this.signals));
    /** @type {Map<string, ReturnType<SettingsTopics['row']>>} */
    this.rows = new Map();
  }

  /** @param {string} name */
  row(name) {
    const mark = icon('ok');
    const topic = html('span', { class: 'p' });
    const detail = html('span', { class: 'm' });
    const rate = html('span', { class: 'n' });
    const unit = html('span', { class: 'u' }, 'Hz');
    const key = html('button', { type: 'button', class: 'topic', 'data-signal': name }, mark, topic, detail, html('span', { class: 'r' }, rate, unit));
    key.addEventListener('click', () => openTopicPicker(this.store, this.model, name));
    const element = html('li', {}, key);
    this.list.append(element);
    return { element, mark, topic, detail, rate, unit };
  }

  draw() {
    const { frame } = this.store;
    if (!frame) return;
    const isLive = !this.store.isSilent && frame.session.phase === 'monitoring';
    for (const [name, signal] of Object.entries(frame.signals)) {
      const at = this.rows.get(name) ?? this.row(name);
      this.rows.set(name, at);
      const shown = topicWords(signal, this.model.body?.topics[name], isLive, this.store.ink(name).ink === 'not_chosen');
      setText(at.topic, shown.topic);
      setSentence(at.detail, shown.detail);
      setIcon(at.mark, shown.icon);
      setAttribute(at.mark, 'class', shown.icon === 'warn' ? 'i c-warn' : shown.icon === 'unknown' ? 'i dashed' : 'i');
      setText(at.rate, shown.rate);
      show(at.unit, shown.rate !== NOTHING);
    }
    const missing = isLive ? missingWords(frame.recording) : '';
    setSentence(this.missing, missing);
    show(this.missing, missing !== '');
    this.filter(this.#query);
    this.#countThem(frame, isLive);
  }

  /** Shows what a search matches; returns how many there are. @param {string} query */
  filter(query) {
    this.#query = query;
    let hits = 0;
    for (const [name, { element }] of this.rows) {
      const signal = this.store.signal(name);
      const isHit = found(query, ['topics', name, signal?.label, signal?.topic, signal?.type]);
      show(element, isHit);
      hits += Number(isHit);
    }
    show(this.element, hits > 0 || !query);
    return hits;
  }

  /** @param {import('../core/protocol-types.js').State} frame @param {boolean} isLive */
  #countThem(frame, isLive) {
    if (isLive && this.store.now() - this.#asked_ms > 5000) {
      this.#asked_ms = this.store.now();
      this.model.candidates().then(({ candidates, unmapped }) => { this.#unmapped = candidates === null ? null : unmapped; }, () => { this.#unmapped = null; });
    }
    const mapped = new Set(Object.values(frame.signals).flatMap(({ topic }) => (topic ? [topic] : []))).size;
    setSentence(this.count, this.#unmapped === null || !isLive ? `${mapped} used` : `${mapped + this.#unmapped} found, ${mapped} used`);
  }

  stop() {
    this.rows.clear();
  }
}
