// One slide of the slow-down on the page: the rail's, and the one at the same pixels in an alarm's sheet.

import { field, listen, need, setAttribute, setText, setWords } from '../core/dom.js';
import { FAR_ENOUGH, KNOB_PX, Slide } from './slide-layout.js';

/** Border and gap at both ends of the knob's way [px]: slowing.css. */
const ENDS_PX = 8;
/** How long what a wrong press is told stands [ms]. */
const HINT_MS = 2500;
const HINTS = /** @type {const} */ ({ tap: ['Do not tap:', 'slide it'], short: ['Slide it', 'to the end'] });

/**
 * @typedef {{kind: 'off' | 'armed' | 'go', title: string, why: string, label: string}} View
 * @param {HTMLElement} slide
 * @param {{press: () => void, order: (at_ms: number) => void}} on press: it is off, and was pressed; order: when it was let go
 * @returns {{draw: (view: View) => void, stop: () => void}}
 */
export function mountSlide(slide, { press, order }) {
  const gesture = new Slide();
  const [knob, way, title, why] = [need(slide, '.knob'), need(slide, '.way'), field(slide, 'slow-title'), field(slide, 'slow-why')];
  /** @type {View} */
  let view = { kind: 'off', title: '', why: '', label: '' };
  /** @type {readonly [string, string] | null} */
  let hint = null;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let hinting;
  let watching = 0;

  const isMirrored = () => document.documentElement.dataset['hand'] === 'left';

  /** From the end where the knob rests, along its way [px]. @param {number} x_px */
  function along(x_px) {
    const box = slide.getBoundingClientRect();
    return { at_px: (isMirrored() ? box.right - x_px : x_px - box.left) - ENDS_PX / 2, way_px: box.width - ENDS_PX - KNOB_PX };
  }

  function place() {
    const { share, phase } = gesture;
    const moved_px = share * along(0).way_px;
    setAttribute(slide, 'data-moves', phase === 'drag' || phase === 'hold' || null);
    setAttribute(slide, 'data-far', (phase === 'drag' && share >= FAR_ENOUGH) || null);
    knob.style.transform = share ? `translateX(${((isMirrored() ? -1 : 1) * moved_px).toFixed(1)}px)` : '';
    way.style.width = share ? `${(moved_px + KNOB_PX).toFixed(1)}px` : '';
  }

  /** @param {import('./slide-layout.js').Outcome} outcome @param {number} at_ms */
  function end(outcome, at_ms) {
    place();
    if (outcome === 'order') order(at_ms);
    else if (outcome) {
      hint = HINTS[outcome];
      clearTimeout(hinting);
      hinting = setTimeout(() => {
        hint = null;
        draw(view);
      }, HINT_MS);
      draw(view);
    }
  }

  function watch() {
    cancelAnimationFrame(watching);
    const outcome = gesture.look(performance.now());
    place();
    if (outcome) end(outcome, performance.now());
    else if (gesture.phase === 'hold') watching = requestAnimationFrame(watch);
  }

  function rest() {
    if (gesture.phase === 'rest') return;
    gesture.rest();
    place();
  }

  /** @param {View} seen */
  function draw(seen) {
    if (seen.kind !== view.kind) rest();
    if (seen.kind !== 'armed') hint = null;
    view = seen;
    setAttribute(slide, 'data-kind', seen.kind);
    setAttribute(slide, 'aria-label', seen.label);
    setText(title, hint ? hint[0] : seen.title);
    setWords(why, hint ? hint[1] : seen.why);
  }

  const stops = [
    listen(slide, 'click', () => { if (view.kind === 'off') press(); }),
    listen(slide, 'pointerdown', (/** @type {PointerEvent} */ event) => {
      if (view.kind !== 'armed' || event.button !== 0) return;
      const { at_px, way_px } = along(event.clientX);
      gesture.down(event.pointerId, at_px, way_px);
      if (!event.isPrimary) gesture.bar(); // another finger lies on the glass already
      slide.setPointerCapture(event.pointerId); // wherever it goes now, no other key is hit
      place();
    }),
    listen(slide, 'pointermove', (/** @type {PointerEvent} */ event) => {
      if (gesture.phase !== 'drag') return;
      gesture.move(event.pointerId, along(event.clientX).at_px);
      place();
    }),
    listen(slide, 'pointerup', (/** @type {PointerEvent} */ event) => end(gesture.up(event.pointerId), event.timeStamp)),
    listen(slide, 'pointercancel', rest),
    listen(document, 'pointerdown', (/** @type {PointerEvent} */ event) => {
      if (event.isPrimary || gesture.phase === 'rest') return;
      gesture.bar();
      place();
    }, { capture: true }),
    listen(slide, 'keydown', (/** @type {KeyboardEvent} */ event) => {
      if (view.kind !== 'armed' || event.key === 'Tab') return;
      event.preventDefault();
      gesture.press(event.key, event.repeat, performance.now());
      watch();
    }),
    listen(slide, 'keyup', (/** @type {KeyboardEvent} */ event) => {
      if (view.kind !== 'armed') return rest();
      event.preventDefault();
      end(gesture.release(), event.timeStamp);
    }),
    listen(slide, 'blur', rest),
    listen(slide, 'contextmenu', (event) => { if (view.kind === 'armed') event.preventDefault(); }),
    () => clearTimeout(hinting),
  ];
  return { draw, stop: () => stops.forEach((stop) => stop()) };
}
