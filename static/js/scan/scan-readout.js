// The texts of the scan's tab: age of the scan, the nearest return in the corridor, the marked return, the plot for screen readers.

import { field, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { ABSENT, isAbsent, write } from '../core/ink.js';
import { bearingOf } from './scan-frame.js';
import { beamWords, sectorSentences, sectorsOf, unseenOf } from './scan-layout.js';
import { age, bearing, fixed } from '../core/format.js';

/** Least time between two texts of the plot for screen readers [ms]: faster, they would never finish a sentence. */
const DESCRIBE_EVERY_MS = 2000;

/** @typedef {import('./scan-frame.js').Scan} Scan */

export class ScanReadout {
  #described_ms = -Infinity;

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store @param {import('./scan-mark.js').ScanMark} mark */
  constructor(root, store, mark) {
    this.at = (/** @type {string} */ name) => field(root, name);
    this.store = store;
    this.mark = mark;
  }

  /** @param {ReturnType<typeof scanInk>} state of the scan that is shown */
  draw(state) {
    const { at, mark, store } = this;
    const { ink, age_s } = state;
    const scan = store.scans.newest;
    const isThere = scan !== null && !isAbsent(ink);
    const isNow = isThere && ink !== 'stale';
    show(at('none'), !isNow);
    show(at('none-help'), ink === 'not_published');
    show(at('canvas'), isThere);
    show(at('aim'), isThere);
    show(at('late'), isNow && ink === 'ageing');
    if (isNow && ink === 'ageing') setText(at('late'), `${age(age_s, 2)} s`);
    const missing = isThere ? `STALE ${age(age_s)} s` : isAbsent(ink) ? ABSENT[ink] : ink === 'stale' ? 'no scan' : 'waiting for a scan';
    if (!isNow) setText(at('none-words'), ink === 'not_chosen' ? `laser ${missing}` : missing); // a pane of its own has no name
    this.#drawNearest(isNow ? scan : null, isNow ? ink : 'fresh');
    setSentence(at('beams'), isThere && scan ? [beamWords(scan), store.signal('scan')?.value?.mounting].filter(Boolean).join(' · ') : '');
    // The marked return takes the place of the count of beams: the keys below must not move.
    show(at('marked'), mark.at !== null);
    show(at('beams'), mark.at === null);
    show(at('hint'), isNow && mark.at === null);
    setSentence(at('marked'), this.#markedWords());
    show(at('straight'), isThere && !isSteeringKnown(store));
    const note = isThere ? (store.signal('scan')?.note ?? '') : '';
    show(at('note'), note !== '');
    setAttribute(at('note'), 'title', note);
    setSentence(at('note-words'), note);
    setText(at('note-short'), isOfMounting(note) ? 'Mounting' : lacksBumper(note) ? 'No bumper' : 'Note');
    this.#describe(isNow ? scan : null, missing);
  }

  /** @param {Scan | null} scan null: there is none of now @param {import('../core/freshness.js').Ink} ink */
  #drawNearest(scan, ink) {
    const { at } = this;
    const judged = scan?.judged ?? null;
    const side = judged?.beam != null && scan ? bearing(bearingOf(scan, judged.beam)) : null;
    write(at('distance'), ink, judged ? (judged.isBlind ? 'blind' : judged.gap_m !== null ? fixed(judged.gap_m) : 'none') : '–', at('distance-unit'), judged?.gap_m != null ? 'm' : '');
    write(at('bearing'), ink, side?.degrees ?? '–', at('side'), side?.side ?? '');
    const stopping_m = judged?.stopping_m ?? null;
    write(at('stops'), ink, fixed(stopping_m), at('stops-unit'), stopping_m === null ? '' : 'm');
  }

  #markedWords() {
    const { mark, store } = this;
    if (!mark.at) return '';
    const old_s = (store.now() - mark.seen_ms) / 1000 + (store.scans.newest?.age_s ?? 0);
    return `Marked: ${mark.text}, ${mark.isSeen ? '' : 'not seen for '}${age(old_s, 2)} s${mark.isSeen ? ' ago' : ''}`;
  }

  /** Describes the plot to screen readers. @param {Scan | null} scan null: there is none of now @param {string} missing */
  #describe(scan, missing) {
    const { at, store } = this;
    const [canvas, text] = [at('canvas'), at('described')];
    const key = scan ? 'live' : missing.replace(/[\d.,:]+ s/, '');
    if (store.now() - this.#described_ms < DESCRIBE_EVERY_MS && text.dataset['key'] === key) return;
    this.#described_ms = store.now();
    text.dataset['key'] = key;
    if (!scan) {
      setAttribute(canvas, 'aria-label', `Laser scan from above: ${missing === '' ? 'none' : missing}`);
      setText(text, '');
      return;
    }
    const { beam, gap_m, isBlind } = scan.judged;
    const side = beam === null ? null : bearing(bearingOf(scan, beam));
    const where = side ? `, ${side.degrees} ${side.side}` : '';
    const nearest = isBlind ? 'the corridor cannot be seen' : gap_m !== null ? `nearest return in the corridor ${fixed(gap_m)} metres${where}` : 'no return in the corridor';
    setAttribute(canvas, 'aria-label', `Laser scan from above: ${nearest}`);
    const sectors = sectorSentences([...sectorsOf(scan), ...unseenOf(scan)], 6);
    setText(text, `${beamWords(scan)}. ${sectors.length ? `No data from these sectors: ${sectors.join('; ')}.` : ''}`);
  }

  /** Announces the marked return; where there is none, what became of it. @param {string} [instead] */
  announceMark(instead = '') {
    const { at, mark } = this;
    const side = mark.at ? bearing(mark.at.bearing_rad) : null;
    const degrees = mark.at ? Math.round((-mark.at.bearing_rad * 180) / Math.PI) : 0;
    setAttribute(at('aim'), 'aria-valuenow', Math.max(-90, Math.min(90, degrees)));
    setAttribute(at('aim'), 'aria-valuetext', side ? mark.text : instead || 'no return marked');
    setText(at('live'), side ? mark.text : instead);
  }
}

/**
 * Freshness and age of the scan that is shown: it came in its own frame, whatever the state has about a newer one.
 * @param {import('../core/store.js').Store} store
 * @param {import('./scan-glass.js').Shown | null} shown null: none is drawn yet, and the newest will be
 */
export function scanInk(store, shown) {
  const state = store.ink('scan');
  if (!store.scans.newest || isAbsent(state.ink)) return state;
  const { age_s: then_s, at_ms } = shown ?? { age_s: store.scans.newest.age_s, at_ms: store.scans.at_ms };
  const age_s = then_s + (store.now() - at_ms) / 1000;
  // The server has no limit while it does not know the rate of the laser; a picture of a moving world gets ten periods.
  const period_s = store.signal('scan')?.period_s ?? 0.1;
  return { ink: age_s > Math.max(1, 10 * period_s) ? /** @type {const} */ ('stale') : state.ink, age_s };
}

/** Whether what is to be known of the scan is where its laser is mounted. @param {string} note */
export function isOfMounting(note) {
  return /mounting|assumed to look/i.test(note);
}

/** Whether gaps count from the laser, for the bumper is not set. @param {string} note */
export function lacksBumper(note) {
  return note.includes('no bumper');
}

/** Without the steering angle the corridor is drawn straight. @param {import('../core/store.js').Store} store */
function isSteeringKnown(store) {
  const { ink } = store.ink('steering');
  if (store.signal('steering')?.value?.tyre_rad == null) return false;
  return ink === 'fresh' || ink === 'ageing';
}
