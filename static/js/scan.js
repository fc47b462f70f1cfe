// The scan's tab: the plot, what stands nearest in the corridor, the return that was tapped, and how far the plot reaches.

import { field, listen, setAttribute, setText, setWords, show } from './dom.js';
import { ABSENT, write } from './ink.js';
import { THUMB_PX } from './scan-pick.js';
import { ScanMark } from './scan-mark.js';
import { ScanGlass } from './scan-glass.js';
import { mountTouch } from './scan-touch.js';
import { bearingOf } from './scan-frame.js';
import { REACH_M, beamWords, pinched, placeOf, plotScale, reachWithin, sectorSentences, sectorsOf, unseenOf, zoomed } from './scan-layout.js';
import { age, bearing, fixed } from './words.js';

const REMEMBERED = 'catgraph.range';
/** What a screen reader is told of the plot changes no faster than this [ms]: it would never end a sentence. */
const TOLD_EVERY_MS = 2000;

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 */
export function mount(root, store) {
  const at = (/** @type {string} */ name) => field(root, name);
  const aim = at('aim');
  const glass = new ScanGlass(/** @type {HTMLCanvasElement} */ (at('canvas')));
  const mark = new ScanMark();
  const keys = /** @type {HTMLElement[]} */ ([...root.querySelectorAll('[data-range]')]);
  let reach_m = reachWithin(recall() ?? REACH_M.first);
  let grasped_m = reach_m;
  let isFront = false;
  let told_ms = -Infinity;

  const stops = [
    ...keys.map((key) => listen(key, 'click', () => reach(Number(key.dataset['range'])))),
    listen(at('nearer'), 'click', () => reach(zoomed(reach_m, 1))),
    listen(at('farther'), 'click', () => reach(zoomed(reach_m, -1))),
    listen(root, 'keydown', pressed),
    listen(window, 'catgraph-theme', themed),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', themed),
    listen(window, 'resize', drawSoon),
    mountTouch(aim, {
      grasp: () => { grasped_m = reach_m; },
      pinch: (from_px, to_px) => reach(pinched(grasped_m, from_px, to_px)),
      tap: touch,
      wheel: (sign) => reach(zoomed(reach_m, sign)),
    }),
    store.on('scan', heard),
    store.on('draw', read),
  ];
  // The plot's words wait for their font, or the first picture would be set in another.
  document.fonts.load('700 20px "catgraph numerals"').then(drawSoon, () => {});
  reach(reach_m);
  tellMark();

  function themed() {
    glass.readTheme();
    drawSoon();
  }

  /** @param {number} metres */
  function reach(metres) {
    reach_m = metres;
    for (const key of keys) setAttribute(key, 'aria-pressed', String(Math.abs(Number(key.dataset['range']) - metres) < 0.01));
    setAttribute(at('nearer'), 'aria-disabled', metres <= REACH_M.least);
    setAttribute(at('farther'), 'aria-disabled', metres >= REACH_M.most);
    remember(metres);
    drawSoon();
  }

  /** @param {KeyboardEvent} event */
  function pressed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const zoom = event.key === '+' || event.key === '=' ? 1 : event.key === '-' ? -1 : null;
    if (zoom !== null) reach(zoomed(reach_m, zoom));
    else if (event.target !== aim || !step(event.key)) return;
    event.preventDefault();
  }

  /** @param {string} key */
  function step(key) {
    if (key === 'Escape' && mark.at) mark.clear();
    else {
      const side = /** @type {Record<string, 1 | -1 | 0>} */ ({ ArrowLeft: 1, ArrowRight: -1, Home: 0, Enter: 0, ' ': 0 })[key];
      if (side === undefined || !store.scan || !isLive()) return false;
      mark.step(store.scan, side, reach_m, store.scanAt_ms);
    }
    tellMark();
    return true;
  }

  /** @param {number} x_px @param {number} y_px */
  function touch(x_px, y_px) {
    if (!store.scan || !isLive()) return;
    const scale = plotScale(glass.canvas.clientWidth, glass.canvas.clientHeight, reach_m);
    const { x_m, y_m } = placeOf(scale, x_px, y_px);
    mark.touch(store.scan, x_m, y_m, THUMB_PX / scale.k, store.scanAt_ms);
    tellMark();
  }

  /** By the operator's own doing, or because it is gone: told once, and not with every scan. @param {string} [instead] */
  function tellMark(instead = '') {
    const side = mark.at ? bearing(mark.at.bearing_rad) : null;
    const degrees = mark.at ? Math.round((-mark.at.bearing_rad * 180) / Math.PI) : 0;
    setAttribute(aim, 'aria-valuenow', Math.max(-90, Math.min(90, degrees)));
    setAttribute(aim, 'aria-valuetext', side ? mark.words : instead || 'no return marked');
    setText(at('said'), side ? mark.words : instead);
    read();
    drawSoon();
  }

  function heard() {
    if (store.scan && !mark.hear(store.scan, store.scanAt_ms)) tellMark('the marked return is gone');
    drawSoon();
  }

  function isLive() {
    const { ink } = inkOfScan(store, glass.shown);
    return store.scan !== null && (ink === 'fresh' || ink === 'ageing');
  }

  function drawSoon() {
    if (!isFront) return;
    glass.draw(() => !isFront || !store.scan ? null : {
      scan: store.scan,
      at_ms: store.scanAt_ms,
      around: {
        reach_m, car: carOf(store), limit_m: store.limit('obstacle.standoff_m'),
        mark: mark.at && { x_m: mark.at.x_m, y_m: mark.at.y_m, isSeen: mark.isSeen },
      },
    });
  }

  function read() {
    if (!isFront) return;
    const { ink, age_s } = inkOfScan(store, glass.shown);
    const { scan } = store;
    const isThere = scan !== null && ink !== 'never' && ink !== 'not_published';
    const isNow = isThere && ink !== 'stale';
    if (!isNow && mark.at) {
      mark.clear();
      tellMark('the marked return is gone: no data');
    }
    show(at('none'), !isNow);
    show(glass.canvas, isThere);
    show(aim, isThere);
    show(at('late'), isNow && ink === 'ageing');
    if (isNow && ink === 'ageing') setText(at('late'), `${age(age_s, 2)} s`);
    const missing = isThere ? `STALE ${age(age_s)} s` : ink === 'fresh' || ink === 'ageing' ? 'waiting for a scan' : ABSENT[/** @type {'never'} */ (ink)] ?? 'no scan';
    if (!isNow) setText(at('none-words'), missing);
    const judged = isNow && scan ? scan.judged : null;
    const side = judged?.beam != null && scan ? bearing(bearingOf(scan, judged.beam)) : null;
    const live = isNow ? ink : 'fresh';
    write(at('distance'), live, judged ? (judged.isBlind ? 'blind' : side ? fixed(judged.gap_m) : 'none') : '–', at('distance-unit'), side ? 'm' : '');
    write(at('bearing'), live, side?.degrees ?? '–', at('side'), side?.side ?? '');
    const stopping_m = judged?.stopping_m ?? null;
    write(at('stops'), live, fixed(stopping_m), at('stops-unit'), stopping_m === null ? '' : 'm');
    setWords(at('beams'), isThere && scan ? beamWords(scan) : '');
    // The marked return takes the place of the count of beams: the keys below must not move.
    show(at('marked'), mark.at !== null);
    show(at('beams'), mark.at === null);
    show(at('hint'), isNow && mark.at === null);
    setWords(at('marked'), markedWords());
    show(at('straight'), isThere && !isSteeringKnown(store));
    tell(isNow, scan, missing);
  }

  function markedWords() {
    if (!mark.at) return '';
    const old_s = (store.now() - mark.seen_ms) / 1000 + (store.scan?.age_s ?? 0);
    return `Marked: ${mark.words}, ${mark.isSeen ? '' : 'not seen for '}${age(old_s, 2)} s${mark.isSeen ? ' ago' : ''}`;
  }

  /** The plot in words. @param {boolean} isNow @param {import('./scan-frame.js').Scan | null} scan @param {string} missing */
  function tell(isNow, scan, missing) {
    const key = isNow ? 'live' : missing.replace(/[\d.:]+ s/, '');
    if (store.now() - told_ms < TOLD_EVERY_MS && at('told').dataset['key'] === key) return;
    told_ms = store.now();
    at('told').dataset['key'] = key;
    if (!isNow || !scan) {
      setAttribute(glass.canvas, 'aria-label', `Laser scan from above: ${missing === '' ? 'none' : missing}`);
      setText(at('told'), '');
      return;
    }
    const { beam, gap_m, isBlind } = scan.judged;
    const side = beam === null ? null : bearing(bearingOf(scan, beam));
    const nearest = isBlind ? 'the corridor cannot be seen' : side ? `nearest return in the corridor ${fixed(gap_m)} metres, ${side.degrees} ${side.side}` : 'no return in the corridor';
    setAttribute(glass.canvas, 'aria-label', `Laser scan from above: ${nearest}`);
    const sectors = sectorSentences([...sectorsOf(scan), ...unseenOf(scan)], 6);
    setText(at('told'), `${beamWords(scan)}. ${sectors.length ? `No data from these sectors: ${sectors.join('; ')}.` : ''}`);
  }

  return {
    /**
     * In front, the scan is sent and drawn; otherwise it costs nothing.
     * @param {boolean} isNow
     */
    setFront(isNow) {
      if (isNow === isFront) return;
      isFront = isNow;
      store.watchScan('scan tab', isNow);
      read();
      drawSoon();
    },
    unmount() {
      for (const stop of stops) stop();
      glass.stop();
    },
  };
}

/**
 * The scan on the glass came by its own frame: it is as old as that, whatever the state says of a newer one.
 * @param {import('./store.js').Store} store
 * @param {import('./scan-glass.js').Shown | null} shown null: none is drawn yet, and the newest will be
 */
function inkOfScan(store, shown) {
  const state = store.ink('scan');
  if (!store.scan || state.ink === 'never' || state.ink === 'not_published') return state;
  const { age_s: then_s, at_ms } = shown ?? { age_s: store.scan.age_s, at_ms: store.scanAt_ms };
  const age_s = then_s + (store.now() - at_ms) / 1000;
  // A server that does not know the laser's rate yet is patient with it; a picture of a moving world is not: ten periods.
  const period_s = store.signal('scan')?.period_s ?? 0.1;
  return { ink: age_s > Math.max(1, 10 * period_s) ? /** @type {const} */ ('stale') : state.ink, age_s };
}

/** The car's measures as the obstacle check has them; null before they are known. @param {import('./store.js').Store} store */
function carOf(store) {
  const [half_width_m, wheelbase_m, laser_ahead_m] = ['half_width_m', 'wheelbase_m', 'laser_ahead_m'].map((name) => store.limit(`obstacle.${name}`));
  return half_width_m == null || wheelbase_m == null || laser_ahead_m == null ? null : { half_width_m, wheelbase_m, laser_ahead_m };
}

/** Else the corridor is straight, because nobody can tell better. @param {import('./store.js').Store} store */
function isSteeringKnown(store) {
  const { ink } = store.ink('steering');
  if (store.signal('steering')?.value?.tyre_rad == null) return false;
  return ink === 'fresh' || ink === 'ageing';
}

function recall() {
  try {
    return Number(localStorage.getItem(REMEMBERED)) || null;
  } catch {
    return null;
  }
}

/** @param {number} metres */
function remember(metres) {
  try {
    localStorage.setItem(REMEMBERED, String(metres));
  } catch {
    // no storage: forgotten
  }
}
