// What stands of each of two recordings at the moment of their time line: its name and car, alarms, checks, and the main values.

import { html, icon, setAttribute, setText, setSentence, show, svg } from '../core/dom.js';
import { timeOfDay } from '../core/format.js';
import { freshnessStyle } from '../core/freshness.js';
import { write } from '../core/ink.js';
import { ICONS } from '../core/priority.js';
import { shownIn } from '../core/units.js';
import { nowOf } from '../home/trend-feed.js';
import { SPECS } from '../home/trends-layout.js';
import { checkWords, lineTime, missingWords, placeOf } from './compare-layout.js';
import { dateOf } from './replay-layout.js';

/** Without a frame for so long a recording does not answer [s]: one that stands sends five a second. */
const SILENT_S = 2;
/** Alarms that a card has room for. */
const MOST_ALARMS = 3;

/**
 * @typedef {import('../core/protocol-types.js').RecordedState} RecordedState
 * @typedef {import('../core/protocol-types.js').ReplayState} ReplayState
 * @typedef {import('./compare-layout.js').Name} Name
 * @typedef {{replay: ReplayState, state: RecordedState, notes: string[], got_ms: number}} Seen the newest of one recording
 */

/** The alarms that were active. @param {RecordedState} state */
function activeOf({ alarms }) {
  return alarms.filter(({ active, state }) => active && state !== 'SHELVED');
}

export class SideCard {
  #name = html('b', { class: 'name', dir: 'auto' });
  #about = html('span', { class: 'sub' });
  #clock = html('span', { class: 'n' });
  #missing = html('p', { class: 'missing' });
  #alarms = html('ul', { class: 'stands' });
  #checks = html('span', {});
  #source = html('span', {});
  #remarks = html('span', {});
  #drawn = '';
  /** Leads to the files. */
  change = html('button', { type: 'button', class: 'key' }, 'Change');

  /** @param {Name} side */
  constructor(side) {
    this.side = side;
    const letter = side.toUpperCase();
    this.element = html('section', { class: 'cmp-card', 'data-side': side, 'aria-label': `Recording ${letter}` },
      html('div', { class: 'cmp-head' }, html('b', { class: 'letter' }, letter), html('div', { class: 'who' }, this.#name, this.#about), ...(side === 'b' ? [this.change] : [])),
      html('div', { class: 'cmp-when' }, svg('svg', { class: 'sample', width: 44, height: 4, 'aria-hidden': 'true' }, svg('path', { d: 'M0 2H44' })), html('span', { class: 'sub' }, side === 'a' ? 'solid' : 'dotted'), this.#clock),
      this.#missing, this.#alarms, html('p', { class: 'checks-line' }, html('span', { class: 'sub' }, 'Checks '), this.#checks), html('p', { class: 'sub small notes' }, this.#source, this.#remarks));
  }

  /**
   * @param {Seen} seen
   * @param {import('./compare-layout.js').Place} place
   * @param {string[]} remarks what is to be known of it beside the other one
   * @param {number} silent_s since its last frame
   */
  draw({ replay, state, notes }, place, remarks, silent_s) {
    const missing = missingWords(place, silent_s > SILENT_S ? { ...replay, hangs_s: silent_s } : replay);
    setText(this.#name, replay.title || `${dateOf(replay.start_ms)} ${timeOfDay(replay.start_ms).slice(0, 5)}`);
    setSentence(this.#about, `${replay.vehicle} · ${replay.title ? `${dateOf(replay.start_ms)} ` : ''}${timeOfDay(replay.start_ms)} · ${lineTime(replay.length_s)} long`);
    setText(this.#clock, place.kind === 'in' ? timeOfDay(replay.at_ms) : '');
    setSentence(this.#missing, missing);
    show(this.#missing, missing !== '');
    setAttribute(this.element, 'data-outside', place.kind !== 'in');
    const isKnown = place.kind === 'in' && !replay.is_seeking && silent_s <= SILENT_S;
    setSentence(this.#checks, !isKnown ? '–' : state.session.paused ? 'monitoring was paused' : checkWords(state.checks));
    setText(this.#source, replay.alarms_from === 'recording' ? 'Alarms as recorded. ' : 'Alarms re-evaluated. ');
    setSentence(this.#remarks, [...remarks, ...notes].join(' '));
    this.#drawAlarms(state, isKnown);
  }

  /** @param {RecordedState} state @param {boolean} isKnown */
  #drawAlarms(state, isKnown) {
    const active = isKnown ? activeOf(state) : [];
    const key = JSON.stringify([isKnown, active.map(({ id, title, priority }) => [id, title, priority])]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    const rows = active.slice(0, MOST_ALARMS).map(({ title, priority }) => html('li', { 'data-kind': priority }, icon(ICONS[priority], 's'), html('b', {}, title)));
    if (active.length > MOST_ALARMS) rows.push(html('li', { class: 'sub' }, `and ${active.length - MOST_ALARMS} more`));
    if (!active.length) rows.push(html('li', { class: 'sub' }, isKnown ? 'No alarm' : 'Alarms –'));
    this.#alarms.replaceChildren(...rows);
  }
}

const SHOWN = ['speed', 'acceleration', 'steering', 'brake', 'distance'].flatMap((name) => SPECS.filter((spec) => spec.name === name));

/** The main values of both, side by side. */
export class Figures {
  #time = cell('Time');
  #values = SHOWN.map((spec) => ({ spec, ...cell(spec.label) }));
  #alarms = cell('Alarms');
  element = html('div', { class: 'cmp-figures' }, this.#time.element, ...this.#values.map(({ element }) => element), this.#alarms.element);

  /**
   * @param {Record<Name, Seen>} seen
   * @param {Record<Name, import('./compare-layout.js').Place>} places
   * @param {number} at_s
   * @param {number} now_ms
   */
  draw(seen, places, at_s, now_ms) {
    write(this.#time.a, 'fresh', lineTime(at_s));
    setSentence(this.#time.b, at_s < 0 ? 'before A begins' : 'since A began');
    for (const { spec, a, unit, b } of this.#values) {
      const [first, second] = /** @type {const} */ (['a', 'b']).map((name) => valueOf(seen[name], places[name], spec, now_ms));
      if (!first || !second) continue;
      write(a, first.ink, first.text, unit, first.unit);
      setSentence(b, `B ${second.ink === 'stale' ? 'stale ' : ''}${second.text} ${second.unit}`.trim());
    }
    const [a = '–', b = '–'] = /** @type {const} */ (['a', 'b']).map((name) => (isKnown(seen[name], places[name], now_ms) ? String(activeOf(seen[name].state).length) : '–'));
    write(this.#alarms.a, 'fresh', a);
    setSentence(this.#alarms.b, `B ${b}`);
  }
}

/** @param {string} label */
function cell(label) {
  const [a, unit, b] = [html('span', { class: 'n v' }), html('span', { class: 'u' }), html('span', { class: 'sub' })];
  return { a, unit, b, element: html('div', {}, html('span', { class: 'lab' }, label === 'Time' ? label : `${label} A`), html('span', { class: 'big' }, a, unit), b) };
}

/**
 * @param {Seen} seen
 * @param {import('./compare-layout.js').Place} place
 * @param {import('../home/trends-layout.js').Spec} spec
 * @param {number} now_ms
 */
function valueOf(seen, place, spec, now_ms) {
  const { state, got_ms } = seen;
  if (!isKnown(seen, place, now_ms)) return { ink: /** @type {const} */ ('fresh'), text: '–', unit: '' };
  const lag_s = Math.max(0, now_ms - got_ms) / 1000;
  const signals = /** @type {Record<string, any>} */ (state.signals);
  const { ink, text, value } = nowOf(spec, /** @type {any} */ ({ ink: (/** @type {string} */ name) => freshnessStyle(signals[name], lag_s), signal: (/** @type {string} */ name) => signals[name] }));
  return { ink, text, unit: value === null ? '' : shownIn(0, spec.unit).unit };
}

/** Does it show a moment of its own that is up to date? @param {Seen} seen @param {import('./compare-layout.js').Place} place @param {number} now_ms */
function isKnown({ replay, got_ms }, place, now_ms) {
  return place.kind === 'in' && !replay.is_seeking && now_ms - got_ms <= SILENT_S * 1000;
}

/** Where both are at a moment of the time line. @param {Record<Name, Seen>} seen @param {number} at_s @param {number} shift_s */
export function placesOf(seen, at_s, shift_s) {
  return { a: placeOf(at_s, 0, seen.a.replay.length_s), b: placeOf(at_s, shift_s, seen.b.replay.length_s) };
}

/** What is to be known of a recording beside the other one. @param {Record<Name, Seen>} seen @param {Name} name @param {string} vehicle of this page */
export function remarksOf(seen, name, vehicle) {
  const { replay } = seen[name];
  const isOther = name === 'b' && replay.vehicle !== seen.a.replay.vehicle;
  return [isOther ? 'Another car than A.' : '', replay.settings_from === 'now' ? `Checked with the settings of ${vehicle} now.` : ''].filter(Boolean);
}
