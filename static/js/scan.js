// The scan's tab: the plot, what stands nearest in the corridor, and how far the plot reaches.

import { field, listen, setAttribute, setText, setWords, show } from './dom.js';
import { ABSENT } from './ink.js';
import { ScanPlot } from './scan-plot.js';
import { beamWords, nearestInCorridor } from './scan-layout.js';
import { age, bearing, fixed } from './words.js';

const REMEMBERED = 'catgraph.range';

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 */
export function mount(root, store) {
  const at = (/** @type {string} */ name) => field(root, name);
  const canvas = /** @type {HTMLCanvasElement} */ (at('canvas'));
  const plot = new ScanPlot(canvas);
  const keys = /** @type {HTMLElement[]} */ ([...root.querySelectorAll('[data-range]')]);
  let reach_m = [10, 20, 40, 80].find((one) => one === recall()) ?? 20;
  let isFront = false;
  let isDue = false;

  const stops = [
    ...keys.map((key) => listen(key, 'click', () => reach(Number(key.dataset['range'])))),
    listen(window, 'catgraph-theme', themed),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', themed),
    listen(window, 'resize', drawSoon),
    store.on('scan', drawSoon),
    store.on('draw', read),
  ];
  // The plot's words wait for their font, or the first picture would be set in another.
  document.fonts.load('700 20px "catgraph numerals"').then(drawSoon, () => {});
  reach(reach_m);

  function themed() {
    plot.readTheme();
    drawSoon();
  }

  /** @param {number} metres */
  function reach(metres) {
    reach_m = metres;
    for (const key of keys) setAttribute(key, 'aria-pressed', String(Number(key.dataset['range']) === metres));
    remember(metres);
    drawSoon();
  }

  function drawSoon() {
    if (isDue || !isFront) return;
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      if (!isFront || !store.scan) return;
      plot.draw(store.scan, { reach_m, stopping_m: store.frame?.nearest.stopping_m ?? null, limit_m: store.limit('obstacle.standoff_m') });
    });
  }

  function read() {
    if (!isFront) return;
    const { ink, age_s } = inkOfScan(store);
    const { scan } = store;
    const isThere = scan !== null && ink !== 'never' && ink !== 'not_published';
    const isLive = isThere && ink !== 'stale';
    show(at('none'), !isLive);
    show(canvas, isThere);
    if (!isLive) setText(at('none-words'), isThere ? `STALE ${age(age_s)} s` : ink === 'fresh' || ink === 'ageing' ? 'waiting for a scan' : ABSENT[/** @type {'never'} */ (ink)] ?? 'no scan');
    const nearest = isLive && scan ? nearestInCorridor(scan) : null;
    const side = nearest ? bearing(nearest.bearing_rad) : null;
    setText(at('distance'), nearest ? fixed(nearest.range_m) : isLive ? 'none' : '–');
    setText(at('distance-unit'), nearest ? 'm' : '');
    setText(at('bearing'), side?.degrees ?? '–');
    setText(at('side'), side?.side ?? '');
    const stopping_m = isLive ? (store.frame?.nearest.stopping_m ?? null) : null;
    setText(at('stops'), fixed(stopping_m));
    setText(at('stops-unit'), stopping_m === null ? '' : 'm');
    setWords(at('beams'), isThere && scan ? beamWords(scan) : '');
    setAttribute(canvas, 'aria-label', nearest
      ? `Laser scan from above: nearest return in the corridor ${fixed(nearest.range_m)} metres, ${side?.degrees} ${side?.side}`
      : 'Laser scan from above: no return in the corridor');
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
    },
  };
}

/**
 * The scan on the glass came by its own frame: it is as old as that, whatever the state says of a newer one.
 * @param {import('./store.js').Store} store
 */
function inkOfScan(store) {
  const state = store.ink('scan');
  if (!store.scan || state.ink === 'never' || state.ink === 'not_published') return state;
  const age_s = store.scan.age_s + (store.now() - store.scanAt_ms) / 1000;
  // A server that does not know the laser's rate yet is patient with it; a picture of a moving world is not: ten periods.
  const period_s = store.signal('scan')?.period_s ?? 0.1;
  return { ink: age_s > Math.max(1, 10 * period_s) ? /** @type {const} */ ('stale') : state.ink, age_s };
}

function recall() {
  try {
    return Number(localStorage.getItem(REMEMBERED));
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
