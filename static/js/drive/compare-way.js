// Two drives compared along the way or over time: speed, steering, what happened, B − A, one cursor through all.

import { csvOf } from './compare-way-csv.js';
import { alarmsOf, interventionsOf, summaryOf } from './compare-way-summary.js';
import { aligned, difference, differences } from './compare-way-model.js';
import { axisOf, bothPlot, differencePlot, eventsPlot, speedPlot, waysMap } from './compare-way-plots.js';
import { dayOf, figure, openBoard, options, select } from './drive-board.js';
import { styled } from '../core/style-sheet.js';
import { request, sentenceOf } from '../control/request.js';
import { html, icon, listen, setAttribute, setSentence, textNodes } from '../core/dom.js';
import { duration, fixed, signed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Course} Course
 * @typedef {import('../core/protocol-types.js').LogbookDrive} Drive
 * @typedef {import('./compare-way-model.js').By} By
 * @typedef {import('./compare-way-model.js').Row} Row
 */

/** @param {string} vehicle "": of all cars @param {string | null} first a recording of drive A; null: the newest @param {import('../core/store.js').Store} store */
export async function openCompareWay(vehicle, first, store) {
  if (document.querySelector('.compareway-board')) return;
  await styled('logbook');
  new CompareWay(vehicle, first, store);
}

class CompareWay {
  /** @type {By} */
  #by = 'way';
  /** @type {Row[]} */
  #rows = [];
  /** @type {Map<string, Course>} */
  #courses = new Map();
  /** @type {Map<string, Drive>} */
  #drives = new Map();
  /** @type {ReturnType<typeof waysMap>} */
  #map = null;
  #turn = 0;

  /** @param {string} vehicle @param {string | null} first @param {import('../core/store.js').Store} store */
  constructor(vehicle, first, store) {
    this.title = html('h2', { tabindex: -1 }, 'Compare');
    this.a = select('Drive A');
    this.b = select('Drive B');
    this.names = { a: html('span', {}), b: html('span', {}) };
    this.keys = /** @type {[By, string][]} */ ([['way', 'By distance'], ['time', 'By time']]).map(([by, name]) => {
      const key = html('button', { type: 'button', 'aria-pressed': String(by === this.#by), 'data-by': by }, name);
      listen(key, 'click', () => this.#turnTo(by));
      return key;
    });
    this.csv = html('button', { type: 'button', class: 'cw-csv', 'data-f': 'compare-csv', disabled: true }, icon('download'), 'CSV');
    this.state = html('p', { class: 'state', role: 'status' }, 'Loading the drives…');
    this.figures = html('dl', { class: 'lb-figures cw-figures' });
    this.cursor = html('div', { class: 'cw-cursor' });
    this.slider = /** @type {HTMLInputElement} */ (html('input', { type: 'range', min: 0, max: 0, step: 1, value: 0, 'aria-label': 'Cursor' }));
    this.plots = html('div', { class: 'cw-plots' });
    this.side = html('div', { class: 'cw-side' });
    const head = html('div', { class: 'cw-head' }, choose('A', this.a, this.names.a), choose('B', this.b, this.names.b), html('div', { class: 'cw-how' }, html('div', { class: 'cw-by', role: 'group', 'aria-label': 'Compared' }, ...this.keys), this.csv));
    const view = html('div', { class: 'view lb-view', tabindex: 0, role: 'region', 'aria-label': 'Two drives' }, head, this.state, this.figures, html('div', { class: 'lb-columns cw-columns' }, this.plots, this.side));
    const watch = new ResizeObserver(() => this.#draw());
    openBoard({ kind: 'compareway', label: 'Compare two drives', title: this.title, ends: [], view, store, onClose: () => watch.disconnect() });
    watch.observe(this.plots);
    for (const one of [this.a, this.b]) listen(one, 'change', () => this.#load());
    listen(this.csv, 'click', () => this.#save());
    listen(this.slider, 'input', () => this.#point(Number(this.slider.value)));
    const follow = (/** @type {PointerEvent} */ event) => this.#pointAt(event.clientX - this.plots.getBoundingClientRect().left - 16);
    listen(this.plots, 'pointerdown', follow);
    listen(this.plots, 'pointermove', (event) => {
      if (event.pointerType === 'mouse' || event.buttons) follow(event);
    });
    void this.#begin(vehicle, first);
  }

  /** @param {string} vehicle @param {string | null} first */
  async #begin(vehicle, first) {
    try {
      const { drives } = /** @type {import('../core/protocol-types.js').LogbookAnswer} */ (await request(`/api/logbook?${new URLSearchParams(vehicle ? { vehicle } : {})}`));
      const choices = drives.map((one) => /** @type {[string, string]} */ ([one.id, nameOf(one).join(' · ')]));
      this.#drives = new Map(drives.map((one) => [one.id, one]));
      const a = drives.find(({ id, recordings = [] /* of an older agent */ }) => id === first || (first !== null && recordings.includes(first))) ?? drives[0];
      const b = drives.find(({ id }) => id !== a?.id);
      options(this.a, choices, a?.id ?? '');
      options(this.b, choices, b?.id ?? a?.id ?? '');
      if (!a) setSentence(this.state, 'There is no drive yet.');
      else void this.#load();
    } catch (error) {
      setSentence(this.state, sentenceOf(error));
    }
  }

  async #load() {
    const turn = this.#turn += 1;
    const [a, b] = [this.a.value, this.b.value];
    this.#forget();
    this.#name(this.names.a, a, 'solid line');
    this.#name(this.names.b, b, 'dotted line');
    if (!this.#courses.has(a) || !this.#courses.has(b)) setSentence(this.state, 'Loading the drives…');
    try {
      for (const id of new Set([a, b])) if (!this.#courses.has(id)) this.#courses.set(id, await request(`/api/recordings/${encodeURIComponent(id)}/course`));
      if (turn === this.#turn) this.#turnTo(this.#by);
    } catch (error) {
      if (turn === this.#turn) setSentence(this.state, sentenceOf(error));
    }
  }

  /** The chosen drive in two lines, of which none is cut as the text of a select is. @param {HTMLElement} place @param {string} id @param {string} how it is drawn */
  #name(place, id, how) {
    const drive = this.#drives.get(id);
    if (!drive) return;
    const [day, ...more] = nameOf(drive);
    place.replaceChildren(html('b', {}, ...textNodes(day ?? '')), html('small', {}, ...textNodes([...more, how].join(' · '))));
  }

  /** No figure of the drives before stands under the names of the new ones. */
  #forget() {
    this.#rows = [];
    this.#map = null;
    setAttribute(this.csv, 'disabled', true);
    for (const part of [this.figures, this.plots, this.side]) part.replaceChildren();
  }

  /** @param {By} by */
  #turnTo(by) {
    this.#by = by;
    for (const key of this.keys) key.setAttribute('aria-pressed', String(key.dataset['by'] === by));
    const [a, b] = [this.#courses.get(this.a.value), this.#courses.get(this.b.value)];
    if (!a || !b) return;
    this.#rows = aligned(a, b, by);
    const met = this.#rows.filter((row) => row.b).length;
    setSentence(this.state, !this.#rows.length ? 'The distance of drive A is not known: compare by time.' : met ? '' : 'Drive B passes nowhere along drive A: compare by time.');
    this.slider.max = String(Math.max(0, this.#rows.length - 1));
    this.#draw();
  }

  #draw() {
    const [a, b] = [this.#courses.get(this.a.value), this.#courses.get(this.b.value)];
    const width = Math.floor(this.plots.clientWidth) - 32;
    const rows = this.#rows;
    if (!a || !b || width < 100) return;
    if (!rows.length) {
      this.#forget();
      return;
    }
    setAttribute(this.csv, 'disabled', null);
    const caption = (/** @type {string} */ text) => html('p', {}, text);
    const both = (/** @type {string} */ text, /** @type {SVGElement | null} */ drawing) => (drawing ? [caption(text), drawing] : [caption(`${text}: not known`)]);
    this.plots.replaceChildren(caption('speed, m/s: A solid, B dotted, hatched where B has no data'), speedPlot(rows, width, a.limit_mps), ...both('B − A, m/s', differencePlot(rows, width, 'speed')),
      ...both('steering, % (− left)', bothPlot(rows, width, 'steering', 'Steering', 5)), ...both('steering, B − A, %', differencePlot(rows, width, 'steering')),
      ...both('following error, m/s: speed minus the commanded speed', bothPlot(rows, width, 'follow', 'Following error', 1)), ...both('GPS error, m: one sigma, as the receiver states it', bothPlot(rows, width, 'gps', 'GPS error', 1)),
      caption('alarms, marks, interventions'), eventsPlot(rows, width, this.#by, a.events, b.events), this.cursor, this.slider);
    this.#map = waysMap(rows, Math.max(200, Math.floor(this.side.clientWidth) - 32));
    const most = differences(rows);
    this.side.replaceChildren(
      html('section', {}, html('h3', {}, 'Did the change help?', html('span', {}, `where both drove, ${this.#metWords()}`)), summaryList(summaryOf(rows, this.#by, a, b))),
      html('section', {}, html('h3', {}, 'Both ways', html('span', {}, 'A solid, B dotted')), this.#map?.drawing ?? html('p', { class: 'sub' }, 'not known: one has no position')),
      html('section', {}, html('h3', {}, 'Where they differ most'), most.length ? html('ul', { class: 'cw-most' }, ...most.map((one) => this.#difference(one))) : html('p', { class: 'sub' }, 'nowhere by much')));
    this.#point(Math.min(Number(this.slider.value), rows.length - 1));
  }

  /** What is compared as a table, whole. */
  #save() {
    const [a, b] = [this.#courses.get(this.a.value), this.#courses.get(this.b.value)];
    if (!a || !b || !this.#rows.length) return;
    const blob = new Blob([csvOf(this.#rows, this.#by, a, b)], { type: 'text/csv' });
    const link = /** @type {HTMLAnchorElement} */ (html('a', { href: URL.createObjectURL(blob), download: `compared_${this.a.value}_${this.b.value}.csv` }));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }

  /** @param {import('./compare-way-model.js').Difference} one */
  #difference({ x, text, value }) {
    const key = html('button', { type: 'button' }, html('span', { class: 'n' }, this.#axisWords(x)), html('b', {}, ...textNodes(text)), html('span', { class: 'n' }, value));
    listen(key, 'click', () => this.#point(this.#rows.findIndex((row) => row.x >= x)));
    return html('li', {}, key);
  }

  /** @param {number} px */
  #pointAt(px) {
    const { x } = axisOf(this.#rows, Math.floor(this.plots.clientWidth) - 32);
    const at = x(px);
    const found = this.#rows.findIndex((row) => row.x >= at);
    if (found >= 0) this.#point(found);
  }

  /** @param {number} index */
  #point(index) {
    const row = this.#rows[index];
    const [a, b] = [this.#courses.get(this.a.value), this.#courses.get(this.b.value)];
    if (!row || !a || !b) return;
    this.slider.value = String(index);
    const { px } = axisOf(this.#rows, Math.floor(this.plots.clientWidth) - 32);
    this.cursor.style.transform = `translateX(${(px(row.x) + 16).toFixed(1)}px)`;
    const here = this.#map && row.a.lat !== null ? this.#map.at(row.a) : null;
    const dot = this.#map?.drawing.querySelector('.cw-here');
    if (here && dot) {
      dot.setAttribute('cx', (here[0] ?? 0).toFixed(1));
      dot.setAttribute('cy', (here[1] ?? 0).toFixed(1));
    }
    const number = (/** @type {number | null | undefined} */ value, digits = 1) => (value === null || value === undefined ? null : fixed(value, digits));
    const other = (/** @type {string | null} */ value, unit = '') => `B ${value === null ? 'not known' : `${value}${unit}`}`;
    const delta = difference(row, 'speed');
    const count = (/** @type {import('../core/protocol-types.js').CourseEvent[] | null} */ events) => number(events?.length, 0);
    this.figures.replaceChildren(
      figure('At', this.#axisWords(row.x).split(' ')[0] ?? null, this.#axisWords(row.x).split(' ')[1] ?? '', `A ${duration(row.a.t)}${row.b ? `, B ${duration(row.b.t)}` : ''}`),
      figure('Speed A', number(row.a.speed), 'm/s', `${other(number(row.b?.speed))}${delta === null ? '' : `, ${signed(delta)}`}`),
      figure('Steering A', number(row.a.steering, 0), '%', other(number(row.b?.steering, 0), ' %')),
      figure('Aside', number(row.aside), 'm', 'B from A'),
      figure('Alarms A', count(alarmsOf(a)), '', other(count(alarmsOf(b)))),
      figure('Interventions A', count(interventionsOf(a)), '', other(count(interventionsOf(b)))),
      figure('Time A', duration(a.length_s), '', `B ${duration(b.length_s)}`)); // the last one, for which a phone has no room: the names of the drives have it
    this.slider.setAttribute('aria-valuetext', `${this.#axisWords(row.x)}, A ${number(row.a.speed) ?? 'not known'} m/s`);
  }

  /** How much of A has B beside it. */
  #metWords() {
    const step = (this.#rows[1]?.x ?? 0) - (this.#rows[0]?.x ?? 0);
    return this.#axisWords(step * this.#rows.filter(({ b }) => b).length);
  }

  /** @param {number} x */
  #axisWords(x) {
    if (this.#by === 'time') return `${duration(x)} min`;
    return x >= 1000 ? `${fixed(x / 1000, 2)} km` : `${fixed(x, 0)} m`;
  }
}

/** @param {import('./compare-way-summary.js').Line[]} lines */
function summaryList(lines) {
  const number = (/** @type {import('./compare-way-summary.js').Line} */ { unit }, /** @type {number | null} */ value) => (value === null ? 'not known' : unit ? `${fixed(value, unit === '%' ? 0 : 2)} ${unit}` : String(value));
  return html('dl', { class: 'lb-check' }, ...lines.map((line) => html('div', {}, html('dt', {}, line.name), html('dd', {},
    ...(line.a === null && line.b === null ? [] : [html('b', {}, `A ${number(line, line.a)}, B ${number(line, line.b)}`)]), html('small', {}, ...textNodes(line.words))))));
}

/** Its day first. @param {Drive} one */
function nameOf({ started_ms, title, distance_m, driven_s, parts }) {
  return [dayOf(started_ms), title ?? '', distance_m === null ? '' : `${fixed(distance_m / 1000, 2)} km`, duration(driven_s), parts > 1 ? `${parts} parts` : ''].filter(Boolean);
}

/** The choice lies unseen over the name of what is chosen. @param {string} name @param {HTMLElement} choice @param {HTMLElement} shown */
function choose(name, choice, shown) {
  setAttribute(shown, 'aria-hidden', true);
  return html('div', { class: 'cw-choose' }, html('b', { 'aria-hidden': 'true' }, name), shown, icon('next', 's'), choice);
}
