// The time line of two recordings: a lane each from its beginning to its end with alarms and gaps, one thumb, and the keys that move both.

import { html, icon, listen, setAttribute, setIcon, setText, svg } from '../core/dom.js';
import { spoken, RATES, markPath, placed, rateWords } from './replay-layout.js';
import { lineTime } from './compare-layout.js';

const HEIGHT = 72;
/** Where the lanes are [px]: a mark's middle is 13 below its top. */
const LANES = { a: 8, b: 38 };
const LEFT = 28;

/**
 * @typedef {import('./compare-layout.js').Name} Name
 * @typedef {import('../home/drive-layout.js').Answer} Answer
 */

export class CompareLine {
  #width = 1;
  /** @type {[number, number]} */
  #union = [0, 1];
  #isDown = false;
  #drawn = '';

  /** @param {{seek: (at_s: number) => void, step: (direction: 1 | -1) => void, toggle: () => void, rate: (rate: number) => void, leave: () => void}} act */
  constructor(act) {
    this.lanes = svg('g', {});
    this.head = svg('g', { class: 'head' }, svg('path', { class: 'stem', d: `M0 2V${HEIGHT - 8}` }), svg('path', { class: 'knob', d: `M-9 ${HEIGHT}v-5l9-9 9 9v5z` }));
    this.picture = svg('svg', { height: HEIGHT, 'aria-hidden': 'true' }, this.lanes, this.head);
    this.slider = html('div', { class: 'time-line', role: 'slider', tabindex: 0, 'aria-label': 'Position on the time line of both recordings' }, this.picture);
    this.before = html('button', { type: 'button', class: 'key', 'aria-label': 'Previous alarm of A or B' }, icon('back'), 'Alarm');
    this.play = html('button', { type: 'button', class: 'key' }, icon('play', 'fill'), html('span', {}, 'Play'));
    this.rate = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': 'Playback speed of both', class: 'n' }, ...RATES.map((rate) => html('option', { value: rate }, rateWords(rate)))));
    this.after = html('button', { type: 'button', class: 'key', 'aria-label': 'Next alarm of A or B' }, icon('next'), 'Alarm');
    this.leave = html('button', { type: 'button', class: 'key leave' }, icon('close'), 'Close');
    this.clock = html('b', { class: 'n' });
    this.of = html('span', { class: 'sub' });
    this.element = html('footer', { class: 'cmp-line', 'aria-label': 'Time line of both recordings' }, this.slider,
      html('div', { class: 'tape-keys' }, html('div', { class: 'legend clock' }, html('span', {}, this.clock, ' ', this.of)),
        html('div', { class: 'keysrow' }, this.before, this.play, html('label', { class: 'key' }, this.rate, html('span', { 'aria-hidden': 'true' }, 'Rate')), this.after, this.leave)));
    const resize = new ResizeObserver(() => { this.#drawn = ''; });
    resize.observe(this.slider);
    const follow = (/** @type {PointerEvent} */ event) => {
      const box = this.slider.getBoundingClientRect();
      const share = Math.min(Math.max((event.clientX - box.left - LEFT) / Math.max(1, box.width - LEFT), 0), 1);
      act.seek(this.#union[0] + share * (this.#union[1] - this.#union[0]));
    };
    this.stops = [
      () => resize.disconnect(),
      listen(this.slider, 'pointerdown', (event) => {
        if (event.button !== 0) return;
        this.slider.setPointerCapture(event.pointerId);
        this.slider.focus();
        this.#isDown = true;
        follow(event);
      }),
      listen(this.slider, 'pointermove', (event) => this.#isDown && follow(event)),
      ...['pointerup', 'pointercancel'].map((type) => listen(this.slider, type, () => { this.#isDown = false; })),
      listen(this.before, 'click', () => act.step(-1)),
      listen(this.after, 'click', () => act.step(1)),
      listen(this.play, 'click', () => act.toggle()),
      listen(this.rate, 'change', () => act.rate(Number(this.rate.value))),
      listen(this.leave, 'click', () => act.leave()),
    ];
  }

  unmount() {
    for (const stop of this.stops) stop();
  }

  /**
   * @param {[number, number]} union
   * @param {number} at_s
   * @param {boolean} isPlaying
   * @param {number} rate
   */
  draw(union, at_s, isPlaying, rate) {
    this.#union = union;
    const [from_s, to_s] = union;
    setAttribute(this.head, 'transform', `translate(${this.#x(at_s).toFixed(1)} 0)`);
    setText(this.clock, lineTime(at_s));
    setText(this.of, from_s < 0 ? `of ${lineTime(from_s)} to ${lineTime(to_s)}` : `of ${lineTime(to_s)}`);
    setIcon(this.play, isPlaying ? 'pause' : 'play');
    setText(/** @type {Element} */ (this.play.lastElementChild), isPlaying ? 'Pause' : 'Play');
    if (document.activeElement !== this.rate) this.rate.value = String(rate);
    setAttribute(this.slider, 'aria-valuemin', from_s.toFixed(1));
    setAttribute(this.slider, 'aria-valuemax', to_s.toFixed(1));
    setAttribute(this.slider, 'aria-valuenow', at_s.toFixed(1));
    setAttribute(this.slider, 'aria-valuetext', spoken(at_s - from_s, to_s - from_s));
  }

  /**
   * Both lanes; again only where something changed.
   * @param {Record<Name, {overview: Answer | null, begin_s: number, length_s: number}>} sides
   * @param {string} key that distinguishes them
   */
  fill(sides, key) {
    const width = this.slider.clientWidth;
    if (`${key} ${width} ${this.#union}` === this.#drawn || !width) return;
    this.#drawn = `${key} ${width} ${this.#union}`;
    this.#width = width;
    setAttribute(this.picture, 'width', width);
    this.lanes.replaceChildren(.../** @type {const} */ (['a', 'b']).map((name) => {
      const { overview, begin_s, length_s } = sides[name];
      const [left, right] = [this.#x(begin_s), this.#x(begin_s + length_s)];
      const gaps = (overview?.blind ?? []).map(([a, b]) => svg('rect', { class: 'gap', x: this.#x(begin_s + a).toFixed(1), y: 5, width: Math.max(2, this.#x(begin_s + b) - this.#x(begin_s + a)).toFixed(1), height: 16, fill: 'url(#hatch)' }));
      const marks = placed(/** @type {any} */ (overview?.marks ?? []), length_s, right - left).map((mark) => svg('path', { class: mark.priority, d: markPath({ ...mark, x: left + mark.x }) }, svg('title', {}, `${name.toUpperCase()} ${lineTime(begin_s + mark.at_s)}: ${mark.title}${mark.count > 1 ? ` and ${mark.count - 1} more` : ''}`)));
      return svg('g', { class: 'lane', 'data-side': name, transform: `translate(0 ${LANES[name]})` },
        svg('text', { x: 2, y: 18 }, name.toUpperCase()), svg('path', { class: 'extent', d: `M${left.toFixed(1)} 13H${right.toFixed(1)}M${left.toFixed(1)} 6v14M${right.toFixed(1)} 6v14` }), ...gaps, svg('g', { class: 'marks' }, ...marks));
    }));
  }

  /** @param {number} at_s */
  #x(at_s) {
    const [from_s, to_s] = this.#union;
    return LEFT + ((at_s - from_s) / Math.max(1e-6, to_s - from_s)) * (this.#width - LEFT - 10);
  }
}
