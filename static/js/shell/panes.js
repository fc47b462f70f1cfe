// The panes of a wide screen: their heads, the list of alarms and the log, mounted only while there is a place for them.

import { countWords, rowsOf } from '../alarms/alarms-layout.js';
import { field, html, icon, listen, setAttribute, setText, setSentence, textNodes } from '../core/dom.js';
import { eventWords, gapLine } from '../alarms/log-layout.js';
import { fixed, timeOfDay } from '../core/format.js';
import { alarmInHead } from './dialogs.js';
import { COMPARED_LIVES_S } from '../map/map-text.js';
import { areAlarmsInSight, isWall } from './layout.js';
import { scale } from '../core/scale.js';
import { styled } from '../core/style-sheet.js';
import { veilOf } from './veil.js';
import { Lines, peopleLines, signalLines } from './wall-panes.js';

/** @typedef {import('../core/store.js').Store} Store */

/** Height of a line of the log, as in watch.css [px of the usual size]. */
const LINE_PX = 24;

/**
 * What stands at the right of a pane's head.
 * @param {import('../core/protocol-types.js').State} frame
 * @param {boolean} isChecked messages of the car are judged
 * @param {number} lag_s how old the frame is by now
 */
export function headsOf({ phone, signals, alarms, suppressed, replay, session }, isChecked, lag_s) {
  const isCompared = phone?.used && (phone.compared_age_s ?? Infinity) + lag_s <= COMPARED_LIVES_S; // else it is only drawn
  const { apart_m = null, explained_m = null } = isCompared ? phone : {};
  const beams = signals.scan?.value;
  const rows = rowsOf(alarms, suppressed ?? [], false);
  return {
    map: apart_m === null ? '' : `Distance apart ${fixed(apart_m)}${explained_m === null ? '' : ` of ${fixed(explained_m)}`} m`,
    scan: beams && signals.scan?.freshness !== 'stale' ? `${beams.usable} of ${beams.beams} beams` : signals.scan?.freshness === 'stale' ? 'stale' : '',
    alarms: replay ? 'as recorded' : rows.length ? countWords(rows) : session.paused ? '' : isChecked ? 'none active' : 'not checked',
  };
}

/**
 * @param {HTMLElement} monitor
 * @param {Store} store
 */
export function mount(monitor, store) {
  const panes = new Panes(monitor, store);
  panes.draw();
  const stops = [store.on('draw', () => panes.draw()), listen(window, 'resize', () => panes.draw())];
  return () => {
    stops.forEach((stop) => stop());
    panes.stop();
  };
}

class Panes {
  /** The sheet of the widest screens. @type {Promise<unknown> | undefined} */
  dress;

  /** @param {HTMLElement} monitor @param {Store} store */
  constructor(monitor, store) {
    this.monitor = monitor;
    this.store = store;
    this.log = new LogPane(field(monitor, 'pane-log'), store);
    this.signals = new Lines(field(monitor, 'pane-signals'));
    this.people = new Lines(field(monitor, 'pane-people'));
    this.heads = /** @type {const} */ (['map', 'scan', 'alarms']).map((name) => ({ name, element: field(monitor, `head-${name}`) }));
    const alarms = field(monitor, 'pane-alarms');
    this.list = new Lodger(alarms, 'The list of alarms', async () => {
      const { mount: fill } = await import('../alarms/alarms.js');
      return () => fill(alarms, store, { inHead: () => alarmInHead(monitor) });
    });
  }

  /** Out of sight it is not there: it costs nothing, and an alarm that came meanwhile was not seen. */
  draw() {
    const { store } = this;
    const { frame } = store;
    const isInSight = frame !== null && areAlarmsInSight();
    void this.list.want(isInSight);
    if (!isInSight) return;
    if (isWall()) this.dress ??= styled('wall');
    const heads = headsOf(frame, store.chain.state === 'Live', store.lag_s);
    const covered = veilOf(this.store);
    for (const { name, element } of this.heads) setSentence(element, covered === 'all' || (covered && name !== 'alarms') ? '' : heads[name]); // a covered pane has no text
    this.log.draw();
    const more = this.signals.draw(() => signalLines(frame.signals, store.lag_s));
    const shown = this.signals.list.children.length;
    setSentence(field(this.monitor, 'head-signals'), more ? `Signals, ${shown} of ${shown + more}` : 'Signals');
    const { head, lines } = peopleLines(store.isSilent ? null : frame.replay ? frame.live?.reach : frame.reach, store.control, store.page);
    const left = this.people.draw(() => lines);
    setSentence(field(this.monitor, 'head-people'), `${frame.replay ? 'live: ' : ''}${head}${left ? `, ${lines.length - left} shown` : ''}`);
  }

  stop() {
    this.signals.stop();
    this.people.stop();
    void this.list.want(false);
  }
}

/** What fills a pane while it is wanted, fetched when it first is. */
class Lodger {
  #isWanted = false;
  /** @type {(() => void) | null} */
  #unmount = null;

  /**
   * @param {HTMLElement} place
   * @param {string} what
   * @param {() => Promise<() => () => void>} fetch resolves to what mounts it
   */
  constructor(place, what, fetch) {
    this.place = place;
    this.what = what;
    this.fetch = fetch;
  }

  /** @param {boolean} isWanted */
  async want(isWanted) {
    if (isWanted === this.#isWanted) return;
    this.#isWanted = isWanted;
    if (!isWanted) {
      this.#unmount?.();
      this.#unmount = null;
      return;
    }
    const fill = await this.fetch().catch(() => null);
    if (!this.#isWanted || this.#unmount) return;
    if (fill) this.#unmount = fill();
    else setText(this.place, `${this.what} could not be loaded from the server. Reload the page.`);
  }
}

/** The newest events, a line each, as many as are seen whole; beside a replay, those of the recording. */
class LogPane {
  #shown = '';
  #lines = 0;
  /** Reads the recording that is shown; fetched with the first. @type {typeof import('../replay/recorded-log.js').shownLines | undefined} */
  #recorded;
  /** Why nothing of the recording is listed. */
  #unread = '';

  /** @param {HTMLElement} list @param {Store} store */
  constructor(list, store) {
    this.list = list;
    this.store = store;
    this.head = /** @type {HTMLElement} */ (list.parentElement?.querySelector('.ph .end'));
    new ResizeObserver(([entry]) => {
      this.#lines = Math.floor((entry?.contentRect.height ?? 0) / (LINE_PX * scale()));
      this.draw();
    }).observe(list);
  }

  draw() {
    const { frame, log: { rows, last, measured } } = this.store;
    const replay = frame?.replay;
    setText(this.head, replay ? 'of the recording, newest first' : 'newest first');
    if (replay && !this.#recorded) {
      this.#recorded = () => [];
      this.#unread = 'The recording is being read.';
      import('../replay/recorded-log.js').then(({ shownLines }) => [this.#recorded, this.#unread] = [shownLines, ''], () => { this.#unread = 'The log could not be loaded. Reload the page.'; });
    }
    const recorded = replay && (this.#recorded?.(replay) ?? []).slice(0, this.#lines);
    const key = recorded ? this.#unread + JSON.stringify(recorded) : `${last} ${measured} ${rows.length} ${this.#lines}`;
    if (key === this.#shown) return;
    this.#shown = key;
    const lines = recorded ?? rows.slice(0, this.#lines).map(liveOf);
    this.list.replaceChildren(...lines.map(lineOf), ...(lines.length ? [] : [html('li', {}, html('span'), html('span'), html('span', { class: 't' }, replay ? this.#unread || 'No entries up to this time.' : 'No entries received.'))]));
  }
}

/** @param {import('../core/event-log.js').Row} row */
function liveOf({ event, gap }) {
  const shown = event ? eventWords(event) : { icon: 'link-off', kind: '', title: gapLine(gap), text: '' };
  return { ...shown, at_ms: event?.at_ms ?? gap?.at_ms ?? null, priority: event?.priority ?? null };
}

/** @param {{at_ms: number | null, icon: string, kind: string, title: string, text: string, priority: string | null}} shown */
function lineOf({ at_ms, icon: glyph, kind, title, text, priority }) {
  const line = html('li', {}, html('span', { class: 'n' }, timeOfDay(at_ms)), icon(glyph, `s ${kind}`), html('span', { class: 't' }, ...textNodes(title)), html('span', { class: 'm' }, ...textNodes(text)));
  setAttribute(line, 'data-kind', priority);
  return line;
}
