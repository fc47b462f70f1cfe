// The panes that only the widest screens have: rate and age of each signal, and who watches this car.

import { html, setAttribute, setSentence } from '../core/dom.js';
import { age, counted, fixed, NOTHING } from '../core/format.js';
import { freshnessStyle } from '../core/freshness.js';
import { ABSENT, isAbsent } from '../core/ink.js';
import { scale } from '../core/scale.js';

/**
 * @typedef {import('../core/protocol-types.js').State} State
 * @typedef {import('../core/protocol-types.js').ReachState} Reach
 * @typedef {import('../core/protocol-types.js').ControlState} Control
 * @typedef {{key: string, cells: string[], ink?: string, of?: string}} Line of: the signal whose age it has
 */

/** Height of a line, as in wall.css [px of the usual size]. */
const LINE_PX = 26;

/**
 * Rate and age of each signal that is published: what is stale or absent first, then what is ageing, for the pane may not have room for all.
 * @param {State['signals']} signals
 * @param {number} lag_s how old the frame is by now
 * @returns {Line[]}
 */
export function signalLines(signals, lag_s) {
  const published = Object.entries(signals).filter(([, signal]) => signal.freshness !== 'not_published').map(([name, signal]) => ({ name, signal, ...freshnessStyle(signal, lag_s) }));
  const rank = (/** @type {string} */ ink) => ['ageing', 'fresh'].indexOf(ink);
  return published.sort((a, b) => rank(a.ink) - rank(b.ink)).map(({ name, signal: { label, rate_hz }, ink, age_s }) => ({
    key: name, ink, of: name,
    cells: [label, isAbsent(ink) ? ABSENT[ink] : `${rate_hz === null || rate_hz === undefined ? NOTHING : fixed(rate_hz)} Hz`, age_s === null ? NOTHING : `${ink === 'stale' ? 'STALE ' : ''}${age(age_s, 2)} s`],
  }));
}

/**
 * Who has this car on a page: who is in control first, then who cannot hear alarms, then this page; the pane may not have room for all.
 * @param {Reach | null | undefined} reach
 * @param {Control | null} control
 * @param {string} page of this screen
 * @returns {{head: string, lines: Line[]}}
 */
export function peopleLines(reach, control, page) {
  if (!reach) return { head: 'unknown', lines: [{ key: '', cells: ['No list received', '', '', ''] }] };
  const rank = (/** @type {Reach['pages'][number]} */ one) => (one.page === control?.page ? 0 : !one.can ? 1 : one.page === page ? 2 : 3);
  const lines = [...reach.pages].sort((a, b) => rank(a) - rank(b)).map((one) => ({
    key: one.page,
    cells: [`${one.name}${one.page === page ? ', you' : ''}`, one.page === control?.page ? 'in control' : 'watching', one.can ? 'alarms audible' : one.why_text ?? 'alarms not audible', one.heard_s === null ? NOTHING : `${age(one.heard_s)} s`],
  }));
  return { head: `${counted(reach.pages.length + reach.left_out, 'page')}, alarms audible on ${reach.can}`, lines };
}

/** A list of lines, as many as are seen whole. */
export class Lines {
  #lines = 0;
  #isDisplayed = false;
  /** @type {Map<string, HTMLElement>} */
  #drawn = new Map();

  /** @param {HTMLElement} list */
  constructor(list) {
    this.list = list;
    this.observer = new ResizeObserver((entries) => {
      const { width, height } = entries.at(-1)?.contentRect ?? { width: 0, height: 0 };
      this.#isDisplayed = width > 0;
      this.#lines = Math.floor(height / (LINE_PX * scale()));
    });
    this.observer.observe(list);
  }

  /** @param {() => Line[]} lines requested only where the list is displayed @returns {number} those that there is no room for */
  draw(lines) {
    if (!this.#isDisplayed) return 0;
    const all = lines();
    const shown = all.slice(0, this.#lines);
    const old = this.#drawn;
    this.#drawn = new Map(shown.map(({ key, cells }) => [key, old.get(key) ?? html('li', {}, ...cells.map(() => html('span')))]));
    const elements = [...this.#drawn.values()];
    if (elements.length !== this.list.children.length || elements.some((one, i) => one !== this.list.children[i])) this.list.replaceChildren(...elements);
    shown.forEach(({ cells, ink, of }, i) => {
      const line = elements[i];
      if (!line) return;
      setAttribute(line, 'data-ink', ink ?? null);
      setAttribute(line, 'data-age-of', of ?? null);
      cells.forEach((text, n) => setSentence(/** @type {HTMLElement} */ (line.children[n]), text));
    });
    return all.length - shown.length;
  }

  stop() {
    this.observer.disconnect();
  }
}
