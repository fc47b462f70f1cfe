// Above the ledge: what is spoken while the Mark key is held, and for 6 s what can be done with a fresh mark.

import { Ring, shape } from './drive-parts.js';
import { html, listen, setAttribute, setText, setSentence, show, svg } from '../core/dom.js';
import { fixed, timeOfDay } from '../core/format.js';
import { markedAt, storageText } from './mark-model.js';
import { pickPhoto } from './photo-input.js';
import { quietly } from './marks.js';
import { LONGEST_MS } from './voice.js';

/** So long it stands [ms]. */
export const STAYS_MS = 6000;
const DRAWS_EVERY_MS = 100;
/** Of the level: one bar a quarter of a second. */
const BARS = 40;
const BAR_PX = 6;

/**
 * @typedef {import('./voice.js').Voice} Voice
 * @typedef {{words: (id: string) => void, list: () => void}} Ways what its keys lead to
 */

export class FreshPanel {
  #id = '';
  #until_ms = 0;
  #speed = '';
  /** @type {Voice | null} */
  #voice = null;
  /** @type {number[]} */
  #levels = [];
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #clock;

  /** @param {HTMLElement} place @param {import('./marks.js').Marks} marks @param {import('./marks.js').Say} say @param {Ways} ways */
  constructor(place, marks, say, ways) {
    this.marks = marks;
    this.say = say;
    this.ways = ways;
    this.ring = new Ring();
    this.title = html('p', { class: 't' });
    this.more = html('p', { class: 'm' });
    this.wave = svg('svg', { class: 'wave', viewBox: `0 0 ${BARS * BAR_PX} 46`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, svg('path', { class: 'rest', d: `M0 23H${BARS * BAR_PX}` }), svg('path', { class: 'level' }));
    this.undo = html('button', { type: 'button', class: 'key', 'data-f': 'mark-undo', 'data-operator': '' }, shape('undo'), 'Undo');
    this.photo = html('button', { type: 'button', class: 'key', 'data-f': 'mark-photo', 'data-operator': '' }, shape('camera'), 'Photo');
    this.words = html('button', { type: 'button', class: 'key you', 'data-f': 'mark-words', 'data-operator': '' }, svg('svg', { class: 'i', viewBox: '0 0 24 24', 'aria-hidden': 'true' }, svg('use', { href: '#i-edit' })), 'Words');
    this.keys = html('div', { class: 'fresh-keys' }, this.undo, this.photo, this.words);
    this.live = html('p', { class: 'unseen', role: 'status' });
    this.element = html('div', { class: 'fresh', role: 'group', 'aria-label': 'The mark placed last', hidden: true }, this.ring.element, html('div', { class: 'about' }, this.title, this.wave, this.more), this.keys);
    place.append(this.element, this.live);
    this.stops = [
      listen(this.undo, 'click', () => this.#undo()),
      listen(this.photo, 'click', () => this.#photo()),
      listen(this.words, 'click', () => ways.words(this.#id)),
      marks.onChange(() => quietly(() => this.draw())),
    ];
  }

  stop() {
    this.close();
    for (const stop of this.stops) stop();
  }

  get isOpen() {
    return !this.element.hidden;
  }

  /** A mark was placed. @param {import('./mark-model.js').Mark} mark */
  show(mark) {
    const speed = this.marks.store.isSilent ? undefined : this.marks.store.signal('speed');
    this.#speed = speed?.value && speed.freshness === 'fresh' ? `${fixed(speed.value.speed_mps)} m/s` : '';
    this.#open(mark.id);
    this.#until_ms = performance.now() + STAYS_MS;
    setText(this.live, `Marked ${timeOfDay(markedAt(mark))}`);
    this.draw();
  }

  /** A mark is being spoken of; `show` ends it. @param {import('./mark-model.js').Mark} mark @param {Voice} voice */
  listen(mark, voice) {
    this.#levels = [];
    this.#voice = voice;
    this.#open(mark.id);
    this.#until_ms = Infinity;
    this.draw();
  }

  /** The voice is over; for a while more its mark can be changed. */
  voiceEnded() {
    this.#voice = null;
    this.#until_ms = performance.now() + STAYS_MS;
    this.draw();
  }

  close() {
    clearInterval(this.#clock);
    this.#voice = null;
    show(this.element, false);
    document.documentElement.style.removeProperty('--fresh');
  }

  /** @param {string} id */
  #open(id) {
    this.#id = id;
    setAttribute(this.element, 'data-mark', id);
    show(this.element, true);
    clearInterval(this.#clock);
    this.#clock = setInterval(() => quietly(() => this.draw()), DRAWS_EVERY_MS);
  }

  draw() {
    if (!this.isOpen) return;
    const mark = this.marks.get(this.#id);
    const left_ms = this.#until_ms - performance.now();
    if (!mark || mark.isRemoved || left_ms <= 0) return this.close();
    const voice = this.#voice;
    setAttribute(this.element, 'data-speaking', voice !== null);
    setSentence(this.title, `Mark at ${timeOfDay(markedAt(mark))}`);
    show(this.keys, voice === null);
    show(/** @type {any} */ (this.wave), voice !== null);
    document.documentElement.style.setProperty('--fresh', `${this.element.offsetHeight}px`); // notices stand above it
    if (voice) this.#drawVoice(voice);
    else {
      this.ring.draw(left_ms / STAYS_MS, String(Math.ceil(left_ms / 1000)));
      setSentence(this.more, storedWords(mark, this.#speed, this.marks));
    }
  }

  /** @param {Voice} voice */
  #drawVoice(voice) {
    const { length_ms } = voice;
    this.ring.draw(length_ms / LONGEST_MS, fixed(length_ms / 1000));
    const bars = Math.floor((length_ms / LONGEST_MS) * BARS);
    while (this.#levels.length < bars) this.#levels.push(voice.level);
    setAttribute(/** @type {Element} */ (this.wave.lastElementChild), 'd', levelPath(this.#levels));
    setSentence(this.more, voice.isRecording ? `Listening, ${fixed((LONGEST_MS - length_ms) / 1000)} s left. Let go: stored. Pull left: stored without voice.` : 'Waiting for the microphone. The mark is stored.');
  }

  #undo() {
    void this.marks.remove(this.#id);
    this.close();
  }

  #photo() {
    this.#until_ms = performance.now() + 4 * STAYS_MS; // the camera takes its time
    pickPhoto(this.#id, this.marks, this.say, () => { this.#until_ms = performance.now() + STAYS_MS; });
  }
}

/** @param {number[]} levels 0 … 1 each */
function levelPath(levels) {
  return levels.map((level, i) => `M${i * BAR_PX + 2} ${(23 - 3 - 20 * level).toFixed(1)}V${(23 + 3 + 20 * level).toFixed(1)}`).join('');
}

/** What became of a mark so far. @param {import('./mark-model.js').Mark} mark @param {string} speed @param {import('./marks.js').Marks} marks */
function storedWords(mark, speed, marks) {
  const { voice, photo } = mark;
  const with_ = [...(voice ? [voice.note || `${fixed(voice.length_s)} s of voice`] : []), ...(photo ? [photo.note || 'with a photo'] : []), ...(speed ? [speed] : [])];
  return [...with_, storageText(mark, marks.isKept(mark.id), marks.isDurable)].join(' · ');
}
