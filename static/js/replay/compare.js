// Two recordings beside each other: the one that is replayed and a second one, on one time line. Only the first one's band shows the live car.

import { html, listen, need, setAttribute, setSentence } from '../core/dom.js';
import { chosenSignals } from '../home/drive-choice.js';
import { mountGestures } from '../home/drive-gestures.js';
import { cannotAlign, shiftBy } from './compare-align.js';
import { CompareChart } from './compare-chart.js';
import { SideFeed } from './compare-feed.js';
import { lineByKey, shiftByKey, shiftWords } from './compare-layout.js';
import { CompareLine } from './compare-line.js';
import { Pace } from './compare-pace.js';
import { RANGES, STEPS, build } from './compare-parts.js';
import { openPicker } from './compare-picker.js';
import { NO_ROOM, WIDE, hasRoom } from './compare-room.js';
import { CompareView } from './compare-view.js';
import { Figures, SideCard, placesOf, remarksOf } from './compare-side.js';
import { lead } from './replay.js';
import { markBeside } from './replay-layout.js';
import { chartStyles } from '../home/drive-parts.js';
import { fetchStyle } from '../core/style-sheet.js';

/** @typedef {import('./compare-layout.js').Name} Name */

const OPENS_MS = 25_000;
/** Keys that belong to what has the focus. */
const OWN_KEYS = 'input, select, textarea, button, summary, a, [role="tab"], dialog *';

/** @type {Compare | null} */
let current = null;

/**
 * Show a second recording beside the one that is replayed.
 * @param {string} id
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export async function openBeside(id, store, say) {
  await Promise.all([fetchStyle('/static/css/compare.css'), chartStyles()]);
  say('Opening…');
  const at_s = Math.max(0, store.frame?.replay?.at_s ?? 0);
  const answer = await store.ask('replay', { do: 'beside', recording: id, at_s }, OPENS_MS);
  if (!answer.ok) {
    say(answer.reason ?? 'Refused.', 'Not opened beside');
    return false;
  }
  current?.unmount();
  current = new Compare(id, store, say);
  if (location.hash !== '#home') location.hash = '#home';
  return true;
}

class Compare {
  /** What is known of B. @type {import('./compare-side.js').Seen | null} */
  #second = null;
  #first_ms = 0;
  #token = '';
  #isOver = false;
  #isReopening = false;
  #align = 'start';
  parts = build();
  cards = { a: new SideCard('a'), b: new SideCard('b') };
  figures = new Figures();
  span = new CompareView();

  /** @param {string} id @param {import('../core/store.js').Store} store @param {(sentence: string, title?: string) => void} say */
  constructor(id, store, say) {
    this.id = id;
    this.store = store;
    this.say = say;
    this.monitor = need(document, '#monitor');
    this.pace = new Pace({ now: () => store.now(), ask: (_, order) => lead(/** @type {import('./replay-lead.js').Order} */ (order)) }, say);
    const filled = () => this.#filled();
    this.feeds = { a: new SideFeed(store, filled), b: new SideFeed(store, filled) };
    this.line = new CompareLine({ seek: (at_s) => this.#seek(at_s), step: (direction) => this.#step(direction), toggle: () => this.#toggle(), rate: (rate) => this.pace.setRate(rate), leave: () => this.leave() });
    const { element, sides, figures, stage } = this.parts;
    sides.prepend(this.cards.a.element, this.cards.b.element);
    figures.replaceWith(this.figures.element);
    element.append(this.line.element);
    need(this.monitor, '.view').append(element);
    setAttribute(this.monitor, 'data-compare', true);
    this.chart = new CompareChart(this.parts, this.feeds, store, () => this.#scene());
    this.stops = this.#listen(stage);
    this.#token = store.frame?.replay?.token ?? '';
  }

  /** @param {HTMLElement} stage */
  #listen(stage) {
    const { store, parts } = this;
    return [
      store.on('beat', () => this.#beat()),
      store.on('draw', () => this.#draw()),
      store.on('replay', (message) => this.#received(message)),
      listen(this.cards.b.change, 'click', () => { location.hash = '#files'; }),
      listen(parts.signals, 'click', () => openPicker(this.feeds)),
      ...parts.ranges.map((key, i) => listen(key, 'click', () => this.#look(() => this.span.show(RANGES[i]?.[1] ?? Infinity, this.pace.at_s, this.pace.union)))),
      ...parts.steps.map((key, i) => listen(key, 'click', () => this.#shift(this.pace.shift_s + (STEPS[i]?.[1] ?? 0), ''))),
      ...Object.entries(parts.aligns).map(([how, key]) => listen(key, 'click', () => void this.#alignBy(how))),
      mountGestures(stage, { box: () => this.chart.panes.box, change: (change) => this.#look(() => this.span.change(change, this.pace.union)), read: (share) => this.#seek(this.view[0] + share * (this.view[1] - this.view[0])), hover: () => {}, key: () => false }),
      listen(document, 'keydown', (event) => this.#key(event), { capture: true }),
      listen(matchMedia(WIDE), 'change', () => { if (!hasRoom()) this.say(`${NO_ROOM}. It is shown again when the window is wider.`, 'Comparison hidden'); }),
    ];
  }

  get isShown() {
    return this.parts.element.checkVisibility();
  }

  /** The first recording alone. @param {string} [why] shown, where it ended by itself */
  leave(why) {
    if (this.#isOver) return;
    const { store } = this;
    this.unmount();
    if (store.replaying && why === undefined) void store.ask('replay', { do: 'alone' });
    if (why !== undefined) this.say(why, 'Comparison closed');
    /** @type {HTMLElement | null} */ (this.monitor.querySelector('.scrub .time-line'))?.focus();
  }

  unmount() {
    this.#isOver = true;
    for (const stop of this.stops) stop();
    this.chart.unmount();
    this.line.unmount();
    this.parts.element.remove();
    setAttribute(this.monitor, 'data-compare', null);
    if (current === this) current = null;
  }

  /** A frame of A came. */
  #beat() {
    const { replay } = this.store.frame ?? {};
    if (!replay) {
      if (!this.store.replaying) this.unmount(); // it was left, and with it B
      return;
    }
    if (this.#token && replay.token !== this.#token) void this.#again();
    this.#token = replay.token;
    this.#first_ms = this.store.now();
    this.pace.take('a', replay);
  }

  /** The socket was broken, or another recording is replayed: the server has closed B. */
  async #again() {
    if (this.#isReopening) return;
    this.#isReopening = true;
    this.#second = null;
    delete this.pace.sides.b;
    this.pace.sleep();
    const answer = await this.store.ask('replay', { do: 'beside', recording: this.id, at_s: 0 }, OPENS_MS);
    this.#isReopening = false;
    if (!answer.ok && !answer.isBroken && !this.#isOver) this.leave(answer.reason ?? 'Refused.');
  }

  /** @param {any} message */
  #received(message) {
    if (message.kind === 'beside_ended') this.leave(message.ended);
    else if (message.kind === 'replay') this.unmount();
    else if (message.kind === 'beside') {
      this.#second = { replay: message.replay, state: message.state, notes: message.notes, got_ms: this.store.now() };
      this.pace.take('b', message.replay);
    }
  }

  /** Both as they are known now; null: one is not there yet. @returns {Record<Name, import('./compare-side.js').Seen> | null} */
  get #seen() {
    const { frame } = this.store;
    if (!frame?.replay || !this.#second) return null;
    return { a: { replay: frame.replay, state: frame, notes: [], got_ms: this.#first_ms }, b: this.#second };
  }

  get view() {
    return this.span.view(this.pace.union);
  }

  /** Another part of both. @param {() => void} change */
  #look(change) {
    change();
    this.#draw();
  }

  #scene() {
    const seen = this.#seen;
    if (!seen) return null;
    const side = (/** @type {Name} */ name) => ({ answer: this.feeds[name].answer, begin_s: this.pace.beginOf(name), length_s: seen[name].replay.length_s });
    const [from_s, to_s] = this.view;
    const marks = this.#marks.filter(({ at_s, priority }) => priority !== 'advisory' && at_s >= from_s && at_s <= to_s);
    return { view: this.view, cursor_s: this.pace.at_s, sides: { a: side('a'), b: side('b') }, limits: this.store.frame?.limits ?? {}, marks };
  }

  /** Five times a second. */
  #draw() {
    const { pace, line, parts } = this;
    if (!this.isShown) return pace.sleep();
    const seen = this.#seen;
    setSentence(parts.state, seen ? shiftWords(pace.shift_s) : 'Opening…');
    if (!seen) return;
    if (!pace.isAwake && document.activeElement === document.body) parts.title.focus();
    pace.wake();
    const at_s = pace.at_s;
    if (pace.isPlaying) this.span.keepUp(at_s, pace.union);
    const places = placesOf(seen, at_s, pace.shift_s);
    for (const name of /** @type {const} */ (['a', 'b'])) {
      const { token, length_s } = seen[name].replay;
      const begin_s = pace.beginOf(name);
      this.feeds[name].look(token, chosenSignals(), [this.view[0] - begin_s, this.view[1] - begin_s], length_s);
      this.cards[name].draw(seen[name], places[name], remarksOf(seen, name, this.store.frame?.vehicle ?? ''), (this.store.now() - seen[name].got_ms) / 1000);
    }
    this.figures.draw(seen, places, at_s, this.store.now());
    line.draw(pace.union, at_s, pace.isPlaying, pace.rate);
    const whole = (/** @type {Name} */ name) => ({ overview: this.feeds[name].overview, begin_s: pace.beginOf(name), length_s: seen[name].replay.length_s });
    line.fill({ a: whole('a'), b: whole('b') }, `${this.#overviews} ${pace.shift_s}`);
    this.#drawKeys(seen);
    this.chart.draw(`${this.view} ${at_s.toFixed(3)} ${pace.shift_s}`);
  }

  get #overviews() {
    return ['a', 'b'].map((name) => { const { overview } = this.feeds[/** @type {Name} */ (name)]; return `${overview?.known_s} ${overview?.is_sketch}`; }).join();
  }

  /** @param {Record<Name, import('./compare-side.js').Seen>} seen */
  #drawKeys(seen) {
    const { aligns, ranges } = this.parts;
    const cannot = cannotAlign(this.feeds, { a: seen.a.replay, b: seen.b.replay });
    for (const [how, key] of Object.entries(aligns)) {
      setAttribute(key, 'aria-pressed', String(how === this.#align));
      setAttribute(key, 'disabled', Boolean(cannot[how]));
      setAttribute(key, 'title', cannot[how] || null);
    }
    ranges.forEach((key, i) => setAttribute(key, 'aria-pressed', String(this.span.width_s === RANGES[i]?.[1])));
  }

  /** New numbers came. */
  #filled() {
    this.chart.filled();
    this.#draw();
  }

  /** @param {number} at_s */
  #seek(at_s) {
    this.#look(() => this.pace.seek(at_s));
  }

  #toggle() {
    this.#look(() => this.pace.toggle());
  }

  /** The alarms of both in the order of the time line. */
  get #marks() {
    return /** @type {const} */ (['a', 'b']).flatMap((side) => (this.feeds[side].overview?.marks ?? []).map((mark) => ({ ...mark, side, at_s: mark.at_s + this.pace.beginOf(side) }))).sort((a, b) => a.at_s - b.at_s);
  }

  /** To the alarm of either before or after. @param {1 | -1} direction */
  #step(direction) {
    const found = markBeside(/** @type {any} */ (this.#marks), this.pace.at_s, direction);
    if (found) this.#seek(found.at_s);
    else this.say(`There is no alarm of A or B ${direction > 0 ? 'after' : 'before'} this moment.`);
  }

  /** @param {number} shift_s @param {string} how '': by hand */
  #shift(shift_s, how) {
    this.#align = how;
    this.pace.setShift(shift_s);
    this.#draw();
  }

  /** @param {string} how */
  async #alignBy(how) {
    const seen = this.#seen;
    const found = seen && (await shiftBy(how, this.feeds, { a: seen.a.replay, b: seen.b.replay }));
    if (!found || this.#isOver) return;
    if (typeof found === 'string') this.say(found, 'Not aligned');
    else this.#shift(found.shift_s, how);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const at = event.target;
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || !this.isShown || document.querySelector('dialog[open]:not([data-docked])')) return;
    if (event.key !== 'Escape' && at instanceof Element && at.matches(OWN_KEYS)) return;
    const shift = shiftByKey(event.key);
    const to_s = lineByKey(event.key, this.pace.at_s, this.pace.union);
    if (event.key === 'Escape') this.leave();
    else if (event.key === ' ') this.#toggle();
    else if (shift !== null) this.#shift(this.pace.shift_s + shift, '');
    else if (to_s !== null) this.#seek(to_s);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

}
