// The nearest object ahead: in digits, and on a tape from the bumper to 20 m.

import { field, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { ABSENT, isAbsent, write, writeAge } from '../core/ink.js';
import { NOTHING, bearing, fixed } from '../core/format.js';

const TAPE = { from: 26, to: 380, metres: 20 };

/**
 * Where a distance stands on the tape, or null where it lies beyond.
 * @param {number | null} distance_m
 */
export function onTape(distance_m) {
  if (distance_m === null || distance_m < 0 || distance_m > TAPE.metres) return null;
  return TAPE.from + ((TAPE.to - TAPE.from) * distance_m) / TAPE.metres;
}

/**
 * What stands at the right of the row.
 * @param {number | null} stopping_m
 * @param {number | null} gap_s null while standing
 * @param {number | null} speed_mps
 */
export function stopsWords(stopping_m, gap_s, speed_mps) {
  if (gap_s === null && speed_mps !== null && Math.abs(speed_mps) < 0.1) return 'standing';
  return stopping_m === null ? '' : `stops in ${fixed(stopping_m)} m`;
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const at = (/** @type {string} */ name) => field(root, name);
  const [age, distance, side, angle, gap, stops, none] = ['age', 'distance', 'side', 'bearing', 'gap', 'stops', 'none'].map(at);
  if (!age || !distance || !side || !angle || !gap || !stops || !none) throw new Error('The template lacks the nearest object');
  const parts = { distance: at('distance-part'), bearing: at('bearing-part'), gap: at('gap-part') };
  const marks = { stopping: at('stopping'), standoff: at('standoff'), object: at('object') };

  function draw() {
    const state = store.ink('distance');
    const value = store.signal('distance')?.value;
    const distance_m = !isAbsent(state.ink) && typeof value?.distance_m === 'number' ? value.distance_m : null;
    const isLive = state.ink === 'fresh' || state.ink === 'ageing';
    if (isAbsent(state.ink)) {
      setAttribute(age, 'data-ink', state.ink);
      setText(age, NOTHING); // why there is none stands below, larger
    } else writeAge(age, state);
    show(parts.distance, distance_m !== null);
    show(none, distance_m === null);
    setText(none, isAbsent(state.ink) ? ABSENT[state.ink] : value?.none_in_range ? 'none in range' : 'distance unknown');
    if (distance_m !== null) write(distance, state.ink, fixed(distance_m));

    const bearingState = store.ink('bearing');
    const where = distance_m === null ? null : bearing(store.signal('bearing')?.value?.bearing_rad);
    show(parts.bearing, where !== null);
    if (where) write(angle, bearingState.ink, where.degrees, side, where.side);

    const near = store.frame?.nearest;
    const gap_s = isLive && distance_m !== null ? (near?.time_gap_s ?? null) : null;
    show(parts.gap, gap_s !== null);
    if (gap_s !== null) write(gap, state.ink, fixed(gap_s, gap_s < 100 ? 1 : 0));
    const speedState = store.ink('speed');
    const isSpeedLive = speedState.ink === 'fresh' || speedState.ink === 'ageing';
    const stopping_m = isSpeedLive ? (near?.stopping_m ?? null) : null;
    const speed_mps = isSpeedLive ? (store.signal('speed')?.value?.speed_mps ?? null) : null;
    setSentence(stops, stopsWords(stopping_m, gap_s, speed_mps));

    const stop = stopping_m === null ? TAPE.from : (onTape(Math.min(stopping_m, TAPE.metres)) ?? TAPE.from);
    setAttribute(marks.stopping, 'width', (stop - TAPE.from).toFixed(1));
    setAttribute(marks.object, 'data-ink', state.ink);
    for (const part of [stops, marks.stopping]) setAttribute(part, 'data-ink', speedState.ink);
    mark(marks.object, isLive ? onTape(distance_m) : null);
    mark(marks.standoff, onTape(store.limit('obstacle.standoff_m')));
  }

  if (store.frame) draw(); // before the first frame it is not shown
  return store.on('draw', () => store.painter.inTurn(draw));
}

/**
 * @param {Element} element
 * @param {number | null} x
 */
function mark(element, x) {
  show(element, x !== null);
  if (x !== null) setAttribute(element, 'transform', `translate(${x.toFixed(1)} 0)`);
}
