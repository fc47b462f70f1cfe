// The chart of the whole drive: up to four signals on one clock, live and of a recording. It fills any box from 300 × 200 px on.

import { listen, setAttribute, setSentence, show, svg } from '../core/dom.js';
import { NOTHING, timeOfDay } from '../core/format.js';
import { isAbsent } from '../core/ink.js';
import { Brush } from './drive-brush.js';
import { chosenSignals } from './drive-choice.js';
import { DriveFeed } from './drive-feed.js';
import { mountGestures } from './drive-gestures.js';
import { foundAt, foundWords, placedMarks, specFor, tagAt, viewAfter } from './drive-layout.js';
import { Panes } from './drive-panes.js';
import { RANGES, build, chartStyles } from './drive-parts.js';
import { DriveView, stateWords } from './drive-view.js';
import { nowOf } from './trend-feed.js';

/** @typedef {import('./drive-layout.js').View} View */

const ICONS = { critical: 'crit', warning: 'warn' };
const TAG_PX = 84;
/** An alarm's mark with the room about it. */
const MARK_PX = 24;
/** A tap so near to the cursor takes it away [px]. */
const AGAIN_PX = 12;

/**
 * @typedef {object} ChartPage
 * @property {import('../core/store.js').Store} store
 * @property {(sentence: string, title?: string) => void} say
 */

/**
 * @param {HTMLElement} root
 * @param {ChartPage} page
 * @returns {() => void} takes it away
 */
export function mount(root, page) {
  let isOver = false;
  /** @type {DriveChart | null} */
  let chart = null;
  void chartStyles().then(() => {
    if (!isOver) chart = new DriveChart(root, page);
  });
  return () => {
    isOver = true;
    chart?.unmount();
    root.replaceChildren();
  };
}

class DriveChart {
  scope = new DriveView();
  /** The moment that was chosen, or under the mouse. @type {number | null} */
  #read_s = null;
  /** @type {number | null} */
  #hover_s = null;
  #context = '';
  #drawn = ''; // what of the picture was drawn last
  #isOver = false;
  #isShown = false; // by its size: to look would make the browser do its style and layout at once
  #turn = () => this.#isOver || this.#look();
  /** @type {import('./trends-layout.js').Spec[]} */
  #specs = [];

  /** @param {HTMLElement} root @param {ChartPage} page */
  constructor(root, { store, say }) {
    this.store = store;
    this.say = say;
    this.parts = build(root);
    const { plots, stage, ranges, signals, now, element } = this.parts;
    this.brush = new Brush((view) => this.#set(view));
    element.append(this.brush.element);
    this.feed = new DriveFeed(store);
    this.panes = new Panes(plots, () => this.#scene());
    this.resize = new ResizeObserver(([plot]) => {
      this.#isShown = (plot?.contentRect.width ?? 0) > 0;
      this.panes.resize();
      this.brush.resize();
      queueMicrotask(() => this.#isOver || this.#filled()); // after the panes have their new size
    });
    this.#rebuild();
    this.resize.observe(plots);
    const anew = () => this.#rebuild();
    this.stops = [
      store.on('draw', () => store.painter.inTurn(this.#turn)),
      ...ranges.map((key, i) => listen(key, 'click', () => this.#follow(RANGES[i]?.[1]))),
      listen(signals, 'click', () => void pick({ store, say, seen: () => ({ answer: this.feed.answer, specs: this.#specs, view: this.view }), panes: this.panes, head: this.parts.head })),
      listen(now, 'click', () => this.#follow()),
      mountGestures(stage, {
        box: () => this.panes.box,
        change: (change) => this.#set(viewAfter(this.view, change, this.feed.end_s)),
        read: (share) => this.#read(this.#at(share)),
        hover: (share) => {
          this.#hover_s = share === null || share < 0 || share > 1 ? null : this.#at(share);
          this.#draw();
        },
        key: (key) => this.#key(key),
      }),
      listen(window, 'catgraph-trends', anew),
      listen(window, 'catgraph-theme', anew),
      listen(window, 'catgraph-units', anew),
      listen(matchMedia('(prefers-color-scheme: light)'), 'change', anew),
    ];
    this.#look();
  }

  unmount() {
    this.#isOver = true;
    for (const stop of this.stops) stop();
    this.resize.disconnect();
    this.brush.unmount();
    this.panes.clear();
  }

  get view() {
    return this.scope.view;
  }

  /** The moment whose values are shown; null: now. */
  get cursor_s() {
    return this.#hover_s ?? this.#read_s ?? this.store.frame?.replay?.at_s ?? null;
  }

  #scene() {
    const { feed, feed: { answer }, store, view } = this;
    const marks = answer ? placedMarks(answer.marks, view, this.panes.area.width) : [];
    /** @type {[number, number][]} */
    const unknown = answer ? [...answer.blind] : [];
    if (answer && !store.replaying && feed.isLate) unknown.push([answer.known_s, feed.end_s]);
    return { answer, view, cursor_s: this.cursor_s, marks, unknown, limits: store.frame?.limits ?? {} };
  }

  /** Other signals, another theme or unit: the panes are built anew. */
  #rebuild() {
    const names = chosenSignals();
    const offered = this.feed.answer?.offered;
    this.#specs = names.map((name) => specFor(name, offered?.[name] ?? this.store.signal(name)));
    this.panes.build(this.#specs);
    this.feed.want(names, this.view);
    setSentence(this.parts.count, `${names.length} of ${Object.keys(offered ?? this.store.frame?.signals ?? {}).length || names.length}`);
    this.#filled();
  }

  /** New numbers came. */
  #filled() {
    const { answer, overview } = this.feed;
    this.feed.isNew = false;
    if (answer && this.#specs.some(({ label, name }) => label === name && answer.offered[name])) return this.#rebuild(); // their names came
    this.#keepUp();
    this.#drawn = '';
    this.panes.fill();
    const [first] = this.#specs;
    if (overview && first) this.brush.fill(overview, first.name);
    this.#draw();
  }

  /** Five times a second. */
  #look() {
    const { frame } = this.store;
    const context = `${frame?.vehicle} ${frame?.replay?.token}`;
    if (context !== this.#context) {
      this.#context = context;
      this.#read_s = this.#hover_s = null;
      this.#follow();
    }
    this.#keepUp();
    this.feed.look();
    if (this.feed.isNew) this.#filled();
    else if (this.#isShown) this.#draw();
  }

  /** Moves the view on with the drive, or with the moment of the replay. */
  #keepUp() {
    const { feed, scope, store } = this;
    if (!feed.answer) return;
    scope.keepUp(feed.end_s, store.frame?.replay);
    feed.want(chosenSignals(), scope.view);
  }

  #draw() {
    const { answer } = this.feed;
    const picture = `${this.view} ${this.cursor_s} ${this.feed.end_s}`;
    if (picture !== this.#drawn && this.panes.area.width > 1) { // panes that were built anew have no place yet
      this.#drawn = picture; // between two answers hardly anything moves
      this.panes.move();
      this.brush.draw(this.view, this.feed.end_s);
      this.#drawHead();
    }
    this.#drawValues();
    const [from_s, to_s] = this.view;
    const { parts: { ranges, stage, state, held, now }, store } = this;
    ranges.forEach((key, i) => setAttribute(key, 'aria-pressed', String(this.scope.follows && this.scope.range_s === RANGES[i]?.[1])));
    const text = stateWords(this.feed, this.view, this.scope.follows, store.replaying);
    setSentence(held, text);
    show(state, text !== '');
    show(now, !this.scope.follows && answer !== null && !this.store.replaying);
    setAttribute(state, 'data-held', !this.scope.follows && !this.store.replaying);
    setAttribute(stage, 'aria-valuemin', from_s.toFixed(1));
    setAttribute(stage, 'aria-valuemax', to_s.toFixed(1));
    setAttribute(stage, 'aria-valuenow', (this.cursor_s ?? to_s).toFixed(1));
    setAttribute(stage, 'aria-valuetext', `${timeOfDay(this.#clock(this.cursor_s ?? to_s))}: ${this.panes.panes.map(({ spec, value, unit }) => `${spec.title} ${value.textContent} ${unit.textContent}`.trim()).join(', ')}`);
  }

  /** The marks and the time at the cursor, above the panes. */
  #drawHead() {
    const { left, width } = this.panes.area;
    const { cursor_s, parts: { head }, view: [from_s, to_s] } = this;
    const placed = this.#scene().marks.map((mark) => ({ ...mark, x: left + mark.x }));
    let at = NaN; // where the tag begins
    const tag = [];
    if (cursor_s !== null && cursor_s >= from_s && cursor_s <= to_s) {
      const x = left + ((cursor_s - from_s) / (to_s - from_s)) * width;
      const middles = (/** @type {typeof placed} */ some) => some.map((mark) => mark.x);
      at = tagAt(x, middles(placed), { left, right: left + width, width: TAG_PX, mark: MARK_PX }, middles(placed.filter(({ priority }) => priority === 'critical')));
      tag.push(...tagPicture(x, at, placed.some((mark) => isUnder(mark.x, at)), timeOfDay(this.#clock(cursor_s))));
    }
    head.replaceChildren(...tag, ...placed.map((mark) => pictureOf(mark, timeOfDay(this.#clock(mark.at_s)), at)));
  }

  /** The value at the cursor beside each pane; without a cursor, or beyond what is known, that of now. */
  #drawValues() {
    const { answer } = this.feed;
    const { cursor_s, store } = this;
    for (const pane of this.panes.panes) {
      const { spec } = pane;
      const trend = answer?.signals[spec.name];
      if (answer && trend && cursor_s !== null) {
        const found = foundAt(trend, answer, cursor_s);
        const isBlind = answer.blind.some(([a, b]) => cursor_s >= a && cursor_s <= b);
        pane.write(isBlind ? 'no data' : foundWords(found, spec), 'fresh', found.kind === 'value' && !isBlind, true);
      } else if (this.scope.follows && !this.feed.isLate && !store.isSilent) {
        const { ink, text, value } = nowOf(spec, store);
        pane.write(isAbsent(ink) && pane.isLow ? NOTHING : text, ink, value !== null);
      } else pane.write('–', 'fresh', true);
    }
  }

  /** @param {number} at_s as ms since 1970 */
  #clock(at_s) {
    return (this.feed.answer?.start_ms ?? 0) + at_s * 1000;
  }

  /** @param {number} share of the width */
  #at(share) {
    return this.view[0] + (this.view[1] - this.view[0]) * Math.max(0, Math.min(1, share));
  }

  /** Another part of the drive. @param {View} view */
  #set(view) {
    this.scope.set(view, this.feed.end_s, this.store.replaying);
    this.feed.want(chosenSignals(), this.view);
    this.#draw();
  }

  /** Back to what goes on. @param {number} [range_s] */
  #follow(range_s) {
    this.scope.follow(range_s);
    this.#keepUp();
    if (this.panes.panes.length) this.#draw();
  }

  /** A moment was chosen: in a replay it is shown, live its values are. @param {number} at_s */
  #read(at_s) {
    if (this.store.replaying) {
      this.#hover_s = null;
      void seek(Math.max(0, at_s), this.say);
      return;
    }
    const isAgain = this.#read_s !== null && Math.abs(this.#read_s - at_s) < ((this.view[1] - this.view[0]) * AGAIN_PX) / this.panes.box.width;
    this.#read_s = isAgain ? null : Math.min(at_s, this.feed.end_s);
    this.#draw();
  }

  /** @param {string} key @returns {boolean} */
  #key(key) {
    const [from_s, to_s] = this.view;
    const step_s = Math.max((to_s - from_s) / 60, 0.25);
    const here_s = this.cursor_s ?? to_s;
    const about = Math.max(0, Math.min(1, (here_s - from_s) / (to_s - from_s)));
    const change = (/** @type {import('./drive-gestures.js').Change} */ one) => this.#set(viewAfter(this.view, one, this.feed.end_s));
    if (key === 'Escape') {
      if (this.#read_s === null) return false;
      this.#read_s = null;
      this.#draw();
      return true;
    }
    const go = (/** @type {number} */ at_s) => {
      if (!this.store.replaying) this.#read_s = null; // a step is no second tap
      this.#read(Math.max(0, from_s, Math.min(to_s, at_s)));
    };
    const acts = /** @type {Record<string, () => void>} */ ({
      ArrowLeft: () => go(here_s - step_s), ArrowRight: () => go(here_s + step_s),
      PageUp: () => change({ pan: 0.5 }), PageDown: () => change({ pan: -0.5 }),
      '+': () => change({ zoom: 0.5, about }), '=': () => change({ zoom: 0.5, about }), '-': () => change({ zoom: 2, about }),
      Home: () => this.#set([0, to_s - from_s]), End: () => this.#set([this.feed.end_s - (to_s - from_s), this.feed.end_s]),
    });
    acts[key]?.();
    return acts[key] !== undefined;
  }
}

/** Whether a mark has no place beside the tag: it is then a bar beneath it, so that it covers no digit. @param {number} x its middle @param {number} at where the tag begins */
const isUnder = (x, at) => Math.abs(x - at - TAG_PX / 2) < (MARK_PX + TAG_PX - 1) / 2;

/** The time at the cursor; where it stands beside it, with a line that leads to it. @param {number} x of the cursor @param {number} at @param {boolean} isOver a mark is beneath it @param {string} clock */
function tagPicture(x, at, isOver, clock) {
  const beside = Math.max(at - x, x - at - TAG_PX);
  return [
    svg('rect', { class: 'tag-box', x: at.toFixed(1), y: 1, width: TAG_PX, height: isOver ? 20 : 26 }), svg('text', { class: 'n tag-text', x: (at + TAG_PX / 2).toFixed(1), y: isOver ? 17 : 20 }, clock),
    ...(beside > 0 ? [svg('rect', { class: 'tag-box', x: (Math.min(x, at + TAG_PX) - 1).toFixed(1), y: 25, width: (beside + 2).toFixed(1), height: 3 })] : []),
  ];
}

/** An alarm's mark in the head of the chart. @param {ReturnType<typeof placedMarks>[number]} mark @param {string} clock @param {number} at where the tag begins */
function pictureOf({ x, priority, title, count }, clock, at) {
  return svg('g', { class: priority, transform: `translate(${(x - 11).toFixed(1)} 3)` }, svg('title', {}, `${clock} ${title}${count > 1 ? ` and ${count - 1} more` : ''}`),
    isUnder(x, at) ? svg('rect', { x: 3, y: 19, width: 16, height: 5, fill: 'currentColor' }) : svg('use', { href: `#i-${ICONS[priority]}`, width: 22, height: 22 }));
}

/** Opens the sheet of signals and export, which is fetched with its first use. @param {import('./drive-picker.js').Chart} chart */
async function pick(chart) {
  try {
    (await import('./drive-picker.js')).openPicker(chart);
  } catch {
    chart.say('The list of signals could not be loaded from the server. Try again.', 'Not opened');
  }
}

/** @param {number} at_s of the recording that is shown @param {ChartPage['say']} say */
async function seek(at_s, say) {
  const { lead } = await import('../replay/replay.js'); // it is here
  const answer = await lead({ do: 'seek', at_s });
  if (!answer.ok) say(answer.reason ?? 'Refused.', 'Not shown');
}
