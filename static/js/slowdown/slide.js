// One slide of the slow-down: the one in the action bar, or the one at the same pixels in an alarm's sheet.

import { field, listen, need, setAttribute, setText, setSentence } from '../core/dom.js';
import { scale } from '../core/scale.js';
import { FAR_ENOUGH, KNOB_PX, Slide } from './slide-layout.js';

/** Border and gap at both ends of the slide, slowing.css [px of the usual size, as all of the gesture]. */
const ENDS_PX = 8;
/** How long the hint after a wrong press is shown [ms]. */
const HINT_MS = 2500;
const HINTS = /** @type {const} */ ({ tap: ['Do not tap:', 'slide it'], short: ['Slide it', 'to the end'] });

/** @typedef {{kind: 'off' | 'armed' | 'go', title: string, why: string, label: string, vehicle?: string}} View vehicle: the car whose name stands on it */

export class SlideKey {
  /** @type {View} */
  #view = { kind: 'off', title: '', why: '', label: '' };
  /** @type {readonly [string, string] | null} */
  #hint = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #hinting;
  #watching = 0;

  /**
   * @param {HTMLElement} slide
   * @param {{press: () => void, order: (at_ms: number, vehicle: string) => void}} on press: pressed while off; order: slid to the end, with the time of the release and the car that was named
   */
  constructor(slide, on) {
    this.gesture = new Slide();
    this.slide = slide;
    this.on = on;
    this.knob = need(slide, '.knob');
    this.trail = need(slide, '.way');
    this.title = field(slide, 'slow-title');
    this.why = field(slide, 'slow-why');
    this.stops = [...this.#pointers(), ...this.#keys()];
  }

  stop() {
    for (const stop of this.stops) stop();
    clearTimeout(this.#hinting);
  }

  /** @param {View} view */
  draw(view) {
    if (view.kind !== this.#view.kind || view.vehicle !== this.#view.vehicle) this.#rest(); // no gesture is carried over to another car
    if (view.kind !== 'armed') this.#hint = null;
    this.#view = view;
    setAttribute(this.slide, 'data-kind', view.kind);
    setAttribute(this.slide, 'aria-label', view.label);
    setText(this.title, this.#hint ? this.#hint[0] : view.title);
    setSentence(this.why, this.#hint ? this.#hint[1] : view.why);
  }

  get #isMirrored() {
    return document.documentElement.dataset['hand'] === 'left';
  }

  get #isArmed() {
    return this.#view.kind === 'armed';
  }

  /** Distance from the end where the knob rests, and the whole distance [px of the usual size]. @param {number} x_px */
  #along(x_px) {
    const box = this.slide.getBoundingClientRect();
    return { at_px: (this.#isMirrored ? box.right - x_px : x_px - box.left) / scale() - ENDS_PX / 2, way_px: box.width / scale() - ENDS_PX - KNOB_PX };
  }

  #place() {
    const { share, phase } = this.gesture;
    const moved_rem = (share * this.#along(0).way_px) / 16;
    setAttribute(this.slide, 'data-moves', phase === 'drag' || phase === 'hold' || null);
    setAttribute(this.slide, 'data-far', (phase === 'drag' && share >= FAR_ENOUGH) || null);
    this.knob.style.transform = share ? `translateX(${((this.#isMirrored ? -1 : 1) * moved_rem).toFixed(3)}rem)` : '';
    this.trail.style.width = share ? `${(moved_rem + KNOB_PX / 16).toFixed(3)}rem` : '';
  }

  /** @param {import('./slide-layout.js').Outcome} outcome @param {number} at_ms */
  #end(outcome, at_ms) {
    this.#place();
    if (outcome === 'order') this.on.order(at_ms, this.#view.vehicle ?? '');
    else if (outcome) {
      this.#hint = HINTS[outcome];
      clearTimeout(this.#hinting);
      this.#hinting = setTimeout(() => {
        this.#hint = null;
        this.draw(this.#view);
      }, HINT_MS);
      this.draw(this.#view);
    }
  }

  /** Follows a key that is held down. */
  #watch() {
    cancelAnimationFrame(this.#watching);
    const outcome = this.gesture.look(performance.now());
    this.#place();
    if (outcome) this.#end(outcome, performance.now());
    else if (this.gesture.phase === 'hold') this.#watching = requestAnimationFrame(() => this.#watch());
  }

  #rest() {
    if (this.gesture.phase === 'rest') return;
    this.gesture.rest();
    this.#place();
  }

  #pointers() {
    const { slide, gesture } = this;
    const rest = () => this.#rest();
    return [
      listen(slide, 'click', () => { if (this.#view.kind === 'off') this.on.press(); }),
      listen(slide, 'pointerdown', (/** @type {PointerEvent} */ event) => {
        if (!this.#isArmed || event.button !== 0) return;
        const { at_px, way_px } = this.#along(event.clientX);
        gesture.down(event.pointerId, at_px, way_px);
        if (!event.isPrimary) gesture.bar(); // another finger is on the screen already
        slide.setPointerCapture(event.pointerId); // wherever it moves now, it presses no other key
        this.#place();
      }),
      listen(slide, 'pointermove', (/** @type {PointerEvent} */ event) => {
        if (gesture.phase !== 'drag') return;
        gesture.move(event.pointerId, this.#along(event.clientX).at_px);
        this.#place();
      }),
      listen(slide, 'pointerup', (/** @type {PointerEvent} */ event) => this.#end(gesture.up(event.pointerId), event.timeStamp)),
      listen(slide, 'pointercancel', rest),
      listen(document, 'pointerdown', (/** @type {PointerEvent} */ event) => {
        if (event.isPrimary || gesture.phase === 'rest') return;
        gesture.bar();
        this.#place();
      }, { capture: true }),
      listen(slide, 'blur', rest),
      listen(slide, 'contextmenu', (event) => { if (this.#isArmed) event.preventDefault(); }),
    ];
  }

  #keys() {
    const { slide, gesture } = this;
    return [
      listen(slide, 'keydown', (/** @type {KeyboardEvent} */ event) => {
        if (!this.#isArmed || event.key === 'Tab') return;
        event.preventDefault();
        gesture.press(event.key, event.repeat, performance.now());
        this.#watch();
      }),
      listen(slide, 'keyup', (/** @type {KeyboardEvent} */ event) => {
        if (!this.#isArmed) return this.#rest();
        event.preventDefault();
        this.#end(gesture.release(), event.timeStamp);
      }),
    ];
  }
}
