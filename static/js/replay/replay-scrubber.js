// In the place of the rail: the time line under the thumb, keys to the events before and after, play, rate, leave.

import { html, icon, listen, setAttribute, setIcon, setText, setSentence, svg } from '../core/dom.js';
import { BASE, HEIGHT, RATES, atByKey, atOf, clockOf, eventsOf, flagPath, gapBands, manualBands, markBeside, markPath, placed, rateWords, speedPath, spoken, xOf } from './replay-layout.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../core/protocol-types.js').Timeline} Timeline
 */

/** While a finger rests on the time line it leads; the moment sent last is waited for so long at most [ms]. */
const HOLD_MS = 1500;
/** Keys that belong to what has the focus. */
const OWN_KEYS = 'input, select, textarea, button, summary, a, [role="slider"], [role="tab"], dialog *';

export class Scrubber {
  /** @type {Timeline | null} */
  #line = null;
  #width = 0;
  #length_s = 0;
  #at_s = 0;
  /** Where the finger is; null: nowhere. @type {number | null} */
  #finger_s = null;
  /** A requested moment that is not shown yet. @type {{at_s: number, since_ms: number} | null} */
  #wanted = null;
  #isAsking = false;
  #isPlaying = false;
  #pressed_ms = -Infinity;
  #notes = '';
  #flags = /** @type {{at_s: number}[]} */ ([]); // what people marked

  /**
   * @param {Store} store
   * @param {import('./replay-lead.js').ReplayLead} leader
   * @param {(sentence: string, title?: string) => void} say
   */
  constructor(store, leader, say) {
    this.store = store;
    this.leader = leader;
    this.say = say;
    this.gaps = svg('g', { class: 'gaps' });
    this.base = svg('path', { class: 'base' });
    this.all = svg('path', { class: 'all' });
    this.past = svg('path', { class: 'past', 'clip-path': 'url(#replay-past)' });
    this.clip = svg('rect', { x: -4, y: 0, height: HEIGHT, width: 0 });
    this.marks = svg('g', { class: 'marks' });
    this.head = svg('g', { class: 'head' }, svg('path', { class: 'stem', d: `M0 22V${BASE}` }), svg('path', { class: 'knob', d: `M-10 ${HEIGHT}v-6l10-8 10 8v6z` }));
    this.picture = svg('svg', { height: HEIGHT, 'aria-hidden': 'true' },
      svg('defs', {}, svg('clipPath', { id: 'replay-past' }, this.clip)),
      this.gaps, this.base, this.all, this.past, this.marks, this.head);
    this.slider = html('div', { class: 'time-line', role: 'slider', tabindex: 0, 'aria-label': 'Position in the recording', 'aria-valuemin': 0, 'aria-valuemax': 0, 'aria-valuenow': 0 }, this.picture);
    this.before = html('button', { type: 'button', class: 'key', 'aria-label': 'Previous event' }, icon('back'), 'Event');
    this.play = html('button', { type: 'button', class: 'key' }, icon('play', 'fill'), html('span', {}, 'Play'));
    this.rate = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': 'Playback speed', class: 'n' }, ...RATES.map((rate) => html('option', { value: rate }, rateWords(rate)))));
    this.rateKey = html('label', { class: 'key' }, this.rate, html('span', { 'aria-hidden': 'true' }, 'Rate'));
    this.after = html('button', { type: 'button', class: 'key', 'aria-label': 'Next event' }, icon('next'), 'Event');
    this.leave = html('button', { type: 'button', class: 'key leave' }, icon('close'), 'Leave');
    this.clock = html('b', { class: 'n' });
    this.of = html('span', { class: 'sub' }, 'Opening…');
    this.note = html('p', { class: 'replay-note', hidden: true });
    this.element = html('footer', { class: 'scrub', 'aria-label': 'Replay' }, this.slider,
      html('div', { class: 'tape-keys' }, html('div', { class: 'legend clock' }, html('span', {}, this.clock, ' ', this.of)),
        html('div', { class: 'keysrow' }, this.before, this.play, this.rateKey, this.after, this.leave)), this.note);
    for (const part of this.#parts) setAttribute(part, 'inert', true); // until it is open
    const resize = new ResizeObserver(() => this.#resized());
    resize.observe(this.slider);
    this.stops = [
      () => resize.disconnect(),
      listen(this.slider, 'pointerdown', (event) => this.#down(event)),
      listen(this.slider, 'pointermove', (event) => this.#move(event)),
      ...['pointerup', 'pointercancel'].map((type) => listen(this.slider, type, (event) => this.#up(event))),
      listen(this.slider, 'keydown', (event) => this.#key(event)),
      listen(this.before, 'click', () => this.#step(-1)),
      listen(this.after, 'click', () => this.#step(1)),
      listen(this.play, 'click', () => this.toggle()),
      listen(this.rate, 'change', () => this.#order({ do: 'rate', rate: Number(this.rate.value) })),
    ];
  }

  unmount() {
    for (const stop of this.stops) stop();
    this.element.remove();
  }

  /** The time line as far as the server has made it. @param {Timeline} line */
  take(line) {
    this.#line = line;
    this.#length_s = line.length_s;
    this.#picture();
    const notes = [...line.notes, ...(line.marks_left_out ? [`${line.marks_left_out} more alarms are not marked.`] : [])].join(' ');
    if (notes !== this.#notes) {
      this.#notes = notes;
      setAttribute(this.note, 'hidden', notes === '');
      setSentence(this.note, notes);
    }
  }

  /** @param {import('../core/protocol-types.js').State} frame */
  draw(frame) {
    const { replay } = frame;
    if (!replay) return;
    if (this.slider.inert) for (const part of this.#parts) setAttribute(part, 'inert', null);
    this.#length_s = replay.length_s;
    const wanted = this.#wanted;
    if (wanted && (Math.abs(replay.at_s - wanted.at_s) < 0.05 || this.store.now() - wanted.since_ms > HOLD_MS) && !this.#isAsking) this.#wanted = null;
    this.#at_s = this.#finger_s ?? this.#wanted?.at_s ?? replay.at_s;
    const x = xOf(this.#at_s, this.#length_s, this.#width);
    setAttribute(this.head, 'transform', `translate(${x.toFixed(1)} 0)`);
    setAttribute(this.clip, 'width', Math.max(0, x + 4).toFixed(1));
    setText(this.clock, clockOf(this.#at_s));
    const slower = replay.reached_rate !== null && replay.is_playing ? `runs at ${rateWords(replay.reached_rate)}` : `of ${clockOf(this.#length_s)}`;
    setSentence(this.of, slower);
    setAttribute(this.slider, 'aria-valuemax', this.#length_s.toFixed(1));
    setAttribute(this.slider, 'aria-valuenow', this.#at_s.toFixed(1));
    setAttribute(this.slider, 'aria-valuetext', spoken(this.#at_s, this.#length_s));
    if (replay.is_playing === this.#isPlaying || this.store.now() - this.#pressed_ms > HOLD_MS) this.#pressed_ms = -Infinity;
    if (this.#pressed_ms === -Infinity) this.#isPlaying = replay.is_playing;
    setIcon(/** @type {Element} */ (this.play.firstElementChild), this.#isPlaying ? 'pause' : 'play');
    setText(/** @type {Element} */ (this.play.lastElementChild), this.#isPlaying ? 'Pause' : 'Play');
    if (document.activeElement !== this.rate) this.rate.value = String(replay.rate);
    for (const [key, way] of /** @type {const} */ ([[this.before, -1], [this.after, 1]])) setAttribute(key, 'aria-disabled', markBeside(this.#events, this.#at_s, way) === null ? 'true' : null);
  }

  /** Flags beneath the trace, and moments to step to. @param {{at_s: number}[]} marks of people */
  flag(marks) {
    this.#flags = marks;
    this.#picture();
  }

  /** What the keys step to. */
  get #events() {
    return eventsOf(this.#line?.marks ?? [], [...this.#flags, ...(this.#line?.interventions ?? [])]);
  }

  /** What acts on a replay that is open. */
  get #parts() {
    return [this.slider, this.before, this.play, this.rateKey, this.after];
  }

  /** To another moment. @param {number} at_s */
  seek(at_s) {
    this.#seek(at_s);
  }

  /** Play or pause; what was pressed counts until the server's state agrees. */
  toggle() {
    this.#order({ do: this.#isPlaying ? 'pause' : 'play' });
    this.#isPlaying = !this.#isPlaying;
    this.#pressed_ms = this.store.now();
    if (this.store.frame) this.draw(this.store.frame);
  }

  /** Space and arrows anywhere on the page, where nothing else has them. @param {KeyboardEvent} event */
  key(event) {
    const at = /** @type {Element} */ (event.target);
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || document.querySelector('dialog[open]:not([data-docked])')) return;
    if (at instanceof Element && at.matches(OWN_KEYS)) return;
    if (event.key === ' ') {
      event.preventDefault();
      if (!event.repeat) this.toggle();
    } else if (event.key === 'ArrowLeft' || event.key === 'ArrowRight') this.#key(event);
  }

  #resized() {
    const width = this.slider.clientWidth;
    if (width === this.#width) return;
    this.#width = width;
    setAttribute(this.picture, 'viewBox', `0 0 ${width} ${HEIGHT}`);
    setAttribute(this.picture, 'width', width);
    setAttribute(this.base, 'd', `M0 ${BASE}H${width}`);
    this.#picture();
    if (this.store.frame) this.draw(this.store.frame);
  }

  #picture() {
    const line = this.#line;
    if (!line || !this.#width) return;
    const path = speedPath(line, this.#width);
    setAttribute(this.all, 'd', path);
    setAttribute(this.past, 'd', path);
    const unread = line.is_done ? [] : [[xOf(line.done_s, line.length_s, this.#width), this.#width]];
    this.gaps.replaceChildren(
      ...manualBands(line, this.#width).map(([x, width]) => svg('rect', { class: 'manual', x, width, y: 26, height: BASE - 26 })),
      ...gapBands(line, this.#width).map(([x, width]) => svg('rect', { x, width, y: 26, height: BASE - 26, fill: 'url(#hatch)' })),
      ...unread.map(([x = 0, end = 0]) => svg('rect', { class: 'unread', x, width: Math.max(0, end - x), y: BASE - 3, height: 6 })),
    );
    this.marks.replaceChildren(...signsOf(line, this.#flags, this.#width));
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.button !== 0) return;
    this.slider.setPointerCapture(event.pointerId);
    this.slider.focus();
    this.#follow(event);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (this.#finger_s !== null) this.#follow(event);
  }

  /** @param {PointerEvent} event */
  #up(event) {
    if (this.#finger_s === null) return;
    this.#follow(event);
    this.#finger_s = null;
  }

  /** @param {PointerEvent} event */
  #follow(event) {
    const box = this.slider.getBoundingClientRect();
    const at_s = atOf(event.clientX - box.left, this.#length_s, box.width);
    this.#finger_s = at_s;
    this.#seek(at_s);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const at_s = atByKey(event.key, this.#at_s, this.#length_s);
    if (at_s === null && event.key !== ' ') return;
    event.preventDefault();
    if (at_s !== null) this.#seek(at_s);
    else if (!event.repeat) this.toggle();
  }

  /** @param {1 | -1} direction */
  #step(direction) {
    const mark = markBeside(this.#events, this.#at_s, direction);
    if (mark) this.#seek(mark.at_s);
    else this.say(`There is no alarm, mark or intervention ${direction > 0 ? 'after' : 'before'} this moment.`);
  }

  /** One seek at a time is under way; of those that come meanwhile, the last counts. @param {number} at_s */
  #seek(at_s) {
    this.#wanted = { at_s, since_ms: this.store.now() };
    if (this.store.frame) this.draw(this.store.frame);
    if (!this.#isAsking) void this.#send();
  }

  async #send() {
    this.#isAsking = true;
    try {
      let sent = NaN;
      while (this.#wanted && this.#wanted.at_s !== sent) {
        sent = this.#wanted.at_s;
        const answer = await this.leader.order({ do: 'seek', at_s: sent });
        if (!answer.ok) {
          this.#wanted = null;
          this.say(answer.reason ?? 'Refused.', 'Position not changed');
        }
      }
    } finally {
      this.#isAsking = false;
    }
  }

  /** @param {import('./replay-lead.js').Order} order */
  async #order(order) {
    const answer = await this.leader.order(order);
    if (!answer.ok) this.say(answer.reason ?? 'Refused.', 'Replay not changed');
  }
}

/** Alarms above the trace, flags and interventions at its base. @param {Timeline} line @param {{at_s: number}[]} flags @param {number} width */
function signsOf(line, flags, width) {
  return [...placed(line.marks, line.length_s, width).map((mark) => svg('path', { class: mark.priority, d: markPath(mark) })),
    ...flags.map(({ at_s }) => svg('path', { class: 'flag', d: flagPath(xOf(at_s, line.length_s, width)) })),
    ...line.interventions.map(({ at_s }) => svg('circle', { class: 'wheel', cx: xOf(at_s, line.length_s, width), cy: BASE, r: 5 }))];
}
