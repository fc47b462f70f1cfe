// The scan's tab: the plot and how far it reaches, the return that was tapped; the texts are in scan-readout.js.

import { field, listen, setAttribute } from '../core/dom.js';
import { openScreen, openSettings } from '../core/open-screen.js';
import { THUMB_PX } from './scan-pick.js';
import { ScanMark } from './scan-mark.js';
import { ScanGlass } from './scan-glass.js';
import { styled } from '../core/style-sheet.js';
import { ScanReadout, isOfMounting, lacksBumper, scanInk } from './scan-readout.js';
import { mountTouch } from './scan-touch.js';
import { REACH_M, pinched, placeOf, plotScale, reachWithin, zoomed } from './scan-layout.js';

const STORED = 'catgraph.range';

/**
 * @param {HTMLElement} root
 * @param {import('../shell/tab-contents.js').TabPage} page
 */
export function mount(root, { store, isFront }) {
  void styled('sources');
  const tab = new ScanTab(root, store);
  const at = (/** @type {string} */ name) => field(root, name);
  const themed = () => {
    tab.glass.readTheme();
    tab.drawSoon();
  };
  let pinchedFrom_m = tab.reach_m;
  const stops = [
    ...tab.ranges.map((key) => listen(key, 'click', () => tab.reach(Number(key.dataset['range'])))),
    listen(at('nearer'), 'click', () => tab.zoom(1)),
    listen(at('farther'), 'click', () => tab.zoom(-1)),
    listen(at('note'), 'click', () => {
      const note = store.signal('scan')?.note ?? '';
      const setting = isOfMounting(note) ? 'mounting' : lacksBumper(note) ? 'bumper' : null;
      return setting ? openSettings(setting) : openScreen('signals', 'scan');
    }),
    listen(root, 'keydown', (event) => tab.press(event)),
    listen(window, 'catgraph-theme', themed),
    listen(matchMedia('(prefers-color-scheme: light)'), 'change', themed),
    listen(window, 'resize', () => tab.drawSoon()),
    mountTouch(at('aim'), {
      grasp: () => { pinchedFrom_m = tab.reach_m; },
      pinch: (from_px, to_px) => tab.reach(pinched(pinchedFrom_m, from_px, to_px)),
      tap: (x_px, y_px) => tab.touch(x_px, y_px),
      wheel: (sign) => tab.zoom(sign),
    }),
    store.on('scan', () => tab.receive()),
    store.on('draw', () => tab.read()),
  ];
  // The plot is drawn again once its font is there, or the first picture would stay in another one.
  document.fonts.load('700 20px "catgraph numerals"').then(() => tab.drawSoon(), () => {});
  tab.reach(tab.reach_m);
  tab.announceMark();
  const look = () => tab.setFront(isFront()); // otherwise it is neither sent nor drawn, and costs nothing
  look();
  return {
    look,
    stop() {
      for (const stop of stops) stop();
      tab.glass.stop();
    },
  };
}

class ScanTab {
  reach_m = reachWithin(recall() ?? REACH_M.first);
  mark = new ScanMark();
  #isFront = false;

  /** @param {HTMLElement} root @param {import('../core/store.js').Store} store */
  constructor(root, store) {
    this.at = (/** @type {string} */ name) => field(root, name);
    this.store = store;
    this.glass = new ScanGlass(/** @type {HTMLCanvasElement} */ (this.at('canvas')), this.at('straight'));
    this.readout = new ScanReadout(root, store, this.mark);
    this.ranges = /** @type {HTMLElement[]} */ ([...root.querySelectorAll('[data-range]')]);
  }

  get #isLive() {
    const { ink } = scanInk(this.store, this.glass.shown);
    return this.store.scans.newest !== null && (ink === 'fresh' || ink === 'ageing');
  }

  /** @param {boolean} isFront */
  setFront(isFront) {
    if (isFront === this.#isFront) return;
    this.#isFront = isFront;
    this.store.scans.watch('scan tab', isFront);
    this.read();
    this.drawSoon();
  }

  /** @param {number} metres */
  reach(metres) {
    this.reach_m = metres;
    for (const key of this.ranges) setAttribute(key, 'aria-pressed', String(Math.abs(Number(key.dataset['range']) - metres) < 0.01));
    setAttribute(this.at('nearer'), 'aria-disabled', metres <= REACH_M.least);
    setAttribute(this.at('farther'), 'aria-disabled', metres >= REACH_M.most);
    remember(metres);
    this.drawSoon();
  }

  /** @param {1 | -1} sign 1: nearer */
  zoom(sign) {
    this.reach(zoomed(this.reach_m, sign));
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const zoom = event.key === '+' || event.key === '=' ? 1 : event.key === '-' ? -1 : null;
    if (zoom !== null) this.zoom(zoom);
    else if (event.target !== this.at('aim') || !this.#step(event.key)) return;
    event.preventDefault();
  }

  /** Marks another return by key; false where the key has no meaning. @param {string} key */
  #step(key) {
    const { mark, store: { scans } } = this;
    if (key === 'Escape' && mark.at) mark.clear();
    else {
      const side = /** @type {Record<string, 1 | -1 | 0>} */ ({ ArrowLeft: 1, ArrowRight: -1, Home: 0, Enter: 0, ' ': 0 })[key];
      if (side === undefined || !scans.newest || !this.#isLive) return false;
      mark.step(newestOf(this.store) ?? scans.newest, side, this.reach_m, scans.at_ms);
    }
    this.announceMark();
    return true;
  }

  /** Marks the return at a point of the plot. @param {number} x_px @param {number} y_px */
  touch(x_px, y_px) {
    const { glass: { canvas }, store: { scans } } = this;
    if (!scans.newest || !this.#isLive) return;
    const scale = plotScale(canvas.clientWidth, canvas.clientHeight, this.reach_m);
    const { x_m, y_m } = placeOf(scale, x_px, y_px);
    this.mark.touch(newestOf(this.store) ?? scans.newest, x_m, y_m, THUMB_PX / scale.k, scans.at_ms);
    this.announceMark();
  }

  /** Announces a change of the mark, by the operator or because the return is gone: once, not with every scan. @param {string} [instead] */
  announceMark(instead) {
    this.readout.announceMark(instead);
    this.read();
    this.drawSoon();
  }

  /** Follows the mark into a new scan. */
  receive() {
    const [newest, { at_ms }] = [newestOf(this.store), this.store.scans];
    if (newest && !this.mark.hear(newest, at_ms)) this.announceMark('the marked return is gone');
    this.drawSoon();
  }

  drawSoon() {
    const { mark, store } = this;
    if (!this.#isFront) return;
    this.glass.draw(() => !this.#isFront || !store.scans.newest ? null : {
      scan: newestOf(store) ?? store.scans.newest,
      at_ms: store.scans.at_ms,
      around: {
        reach_m: this.reach_m, car: carOf(store), limit_m: store.limit('obstacle.standoff_m'),
        mark: mark.at && { x_m: mark.at.x_m, y_m: mark.at.y_m, isSeen: mark.isSeen },
      },
    });
  }

  /** Writes what is read; a return of a scan that is not live is not marked any more. */
  read() {
    if (!this.#isFront) return;
    if (this.mark.at && !this.#isLive) {
      this.mark.clear();
      this.announceMark('the marked return is gone: no data');
    }
    this.readout.draw(scanInk(this.store, this.glass.shown));
  }
}

/** The car's measures as the obstacle check has them; null before they are known. @param {import('../core/store.js').Store} store */
function carOf(store) {
  const [half_width_m, wheelbase_m] = ['half_width_m', 'wheelbase_m'].map((name) => store.limit(`obstacle.${name}`));
  const place = placeOfLaser(store);
  return half_width_m == null || wheelbase_m == null || place === null ? null : { half_width_m, wheelbase_m, laser_ahead_m: place.nose_ahead_m };
}

/** The newest scan, with the laser's place from the car's nose. @param {import('../core/store.js').Store} store */
function newestOf(store) {
  const { newest } = store.scans;
  const place = placeOfLaser(store);
  return newest === null || place === null ? newest : { ...newest, x_m: place.x_m, y_m: place.y_m };
}

/** Where laser and nose are, by the protocol; null before the settings are known. @param {import('../core/store.js').Store} store */
function placeOfLaser(store) {
  const set_m = store.limit('obstacle.laser_ahead_m');
  if (set_m == null) return null;
  const value = store.signal('scan')?.value;
  const laser_ahead_m = value?.laser_ahead_m ?? set_m;
  const foremost_m = [laser_ahead_m, store.limit('obstacle.bumper_ahead_m') || (value?.laser_ahead_m == null ? laser_ahead_m : 0)];
  const nose_ahead_m = Math.max(...foremost_m);
  return { nose_ahead_m, x_m: laser_ahead_m - nose_ahead_m, y_m: value?.laser_left_m ?? 0 };
}

function recall() {
  try {
    return Number(localStorage.getItem(STORED)) || null;
  } catch {
    return null;
  }
}

/** @param {number} metres */
function remember(metres) {
  try {
    localStorage.setItem(STORED, String(metres));
  } catch {
    // without storage the choice is lost
  }
}
