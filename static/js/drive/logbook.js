// The logbook: all drives of a car, on a board of its own over the Files tab.

import { dayOf, figure, openBoard, options, select } from './drive-board.js';
import { dueWords, intervalWords, lastWords } from './due.js';
import { styled } from '../core/style-sheet.js';
import { modesPlot, numberOf, ratePlot } from './logbook-plots.js';
import { request, sentenceOf } from '../control/request.js';
import { keptAt } from '../core/kept-at.js';
import { html, icon, listen, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { counted, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').LogbookAnswer} Answer
 * @typedef {import('../core/protocol-types.js').LogbookDrive} Drive
 * @typedef {import('../core/protocol-types.js').LogbookCheck} Check
 * @typedef {{vehicle: string, tag: string, person: string, weeks: number}} Choice
 */

const WEEK_MS = 7 * 86_400_000;
const SHOWN = 30; // drives in the list; the CSV has all
const CHECKS = { none: 'no check', open: 'check not signed', signed: 'check signed' };

/**
 * @param {object} from
 * @param {string[]} from.vehicles
 * @param {string[]} from.tags
 * @param {string} from.vehicle which to show first
 * @param {import('../core/store.js').Store} from.store
 */
export async function openLogbook(from) {
  if (document.querySelector('.logbook-board')) return;
  await styled('logbook');
  new Logbook(from);
}

class Logbook {
  /** @type {Choice} */
  #choice;
  /** @type {Answer | null} */
  #answer = null;
  #turn = 0;

  /** @param {{vehicles: string[], tags: string[], vehicle: string, store: import('../core/store.js').Store}} from */
  constructor(from) {
    this.store = from.store;
    this.#choice = { vehicle: from.vehicle || (from.vehicles[0] ?? ''), tag: '', person: '', weeks: 24 };
    this.title = html('h2', { tabindex: -1 });
    this.count = html('span', { class: 'end' });
    this.state = html('p', { class: 'state', role: 'status' });
    this.csv = /** @type {HTMLAnchorElement} */ (html('a', { class: 'key', download: '', 'data-f': 'logbook-csv' }, icon('download'), 'CSV'));
    this.person = select('Person');
    this.filters = this.#filters(from);
    this.figures = html('dl', { class: 'lb-figures' });
    this.plots = html('div', { class: 'lb-plots' });
    this.side = html('div', { class: 'lb-side' });
    const view = html('div', { class: 'view lb-view', tabindex: 0, role: 'region', 'aria-label': 'Logbook' }, this.filters, this.state, this.figures, html('div', { class: 'lb-columns' }, this.plots, this.side));
    const watch = new ResizeObserver(() => this.#drawPlots());
    openBoard({ kind: 'logbook', label: 'Logbook', title: this.title, ends: [this.count], view, store: this.store, onClose: () => watch.disconnect() });
    watch.observe(this.plots);
    void this.#load();
  }

  /** @param {{vehicles: string[], tags: string[]}} from */
  #filters(from) {
    const vehicle = select('Vehicle', from.vehicles.map((name) => [name, name]), this.#choice.vehicle);
    const weeks = select('Time', [['12', '12 weeks'], ['24', '24 weeks'], ['52', 'a year'], ['0', 'all']], '24');
    const tag = select('Tag', [['', 'all tags'], ...from.tags.map((name) => /** @type {[string, string]} */ ([name, name]))]);
    listen(vehicle, 'change', () => {
      options(this.person, [['', 'everybody']], '');
      this.#want({ vehicle: vehicle.value, person: '' });
    });
    listen(weeks, 'change', () => this.#want({ weeks: Number(weeks.value) }));
    listen(tag, 'change', () => this.#want({ tag: tag.value }));
    listen(this.person, 'change', () => this.#want({ person: this.person.value }));
    const compare = html('button', { type: 'button', class: 'key', 'data-f': 'logbook-compare' }, 'Compare two drives');
    listen(compare, 'click', async () => {
      try {
        const { openCompareWay } = await import('./compare-way.js');
        await openCompareWay(this.#choice.vehicle, null, this.store);
      } catch {
        setSentence(this.state, 'The comparison could not be loaded from the server. Try again.');
      }
    });
    return html('div', { class: 'lb-filters' }, ...(from.vehicles.length > 1 ? [vehicle] : []), weeks, ...(from.tags.length ? [tag] : []), this.person, this.csv, compare);
  }

  /** @param {Partial<Choice>} choice */
  #want(choice) {
    Object.assign(this.#choice, choice);
    void this.#load();
  }

  async #load() {
    const turn = this.#turn += 1;
    const { vehicle, tag, person, weeks } = this.#choice;
    const query = new URLSearchParams({ ...(vehicle ? { vehicle } : {}), ...(tag ? { tag } : {}), ...(person ? { person } : {}), ...(weeks ? { from: String(Date.now() - weeks * WEEK_MS) } : {}) });
    setText(this.title, `${vehicle || 'Car'} logbook`);
    setAttribute(this.csv, 'href', keptAt(`/api/logbook.csv?${query}`));
    setSentence(this.state, 'Loading the drives…');
    this.#forget();
    try {
      const answer = /** @type {Answer} */ (await request(`/api/logbook?${query}`));
      if (turn !== this.#turn) return;
      this.#answer = answer;
      setSentence(this.state, [...unreadWords(answer), ...(answer.totals.drives ? [] : ['No drives in this time.'])].join(' '));
    } catch (error) {
      if (turn === this.#turn) setSentence(this.state, sentenceOf(error));
      return;
    }
    this.#draw(this.#answer);
  }

  /** No figure of another car or choice stands under the new name. */
  #forget() {
    this.#answer = null;
    setText(this.count, '');
    for (const part of [this.figures, this.plots, this.side]) part.replaceChildren();
  }

  /** @param {Answer} answer */
  #draw({ totals, people, components, drives, checks = [] /* of an older agent */, unread = 0 }) {
    setText(this.count, counted(totals.drives, 'drive'));
    options(this.person, [['', 'everybody'], ...people.map((name) => /** @type {[string, string]} */ ([name, name]))], this.#choice.person);
    show(this.person, people.length > 0);
    const mine = checks.filter(({ vehicle }) => vehicle === this.#choice.vehicle);
    const { distance_m, driven_s, modes_s, modes_m: { autonomous = 0, unknown = 0 } } = totals;
    const share = (/** @type {number} */ part) => (distance_m > 0 ? (100 * part / distance_m).toFixed(0) : null);
    this.figures.replaceChildren(
      figure('Distance', fixed(distance_m / 1000, distance_m < 1e5 ? 1 : 0), 'km', `${hours(driven_s)} h`),
      figure('Autonomous', share(autonomous), '%', `of the distance; ${hours(modes_s['autonomous'])} h, manual ${hours(modes_s['manual'])} h`),
      figure('Not known', share(unknown), '%', `mode of the car, ${hours(modes_s['unknown'])} h`),
      figure('Interventions', totals.interventions === null ? null : numberOf(totals.interventions), 'per 100 km', 'that it drove by itself'),
      figure('Alarms', totals.alarms === null ? null : numberOf(totals.alarms), 'per 100 km', 'of all'),
      overdueFigure(mine) ?? figure('Checks missing', totals.checks_known ? String(totals.checks_missing) : null, '', totals.checks_known ? `of ${counted(totals.checks_known, 'drive')}` : '', totals.checks_missing > 0));
    this.#drawPlots();
    this.side.replaceChildren(
      ...mine.flatMap(({ recurring = [] }) => (recurring.length ? [section('Checks overdue', `${recurring.filter(isOverdue).length} of ${recurring.length}`, dueList(recurring))] : [])),
      ...mine.map((check) => section('Departure check', check.signed_ms === null ? '' : dayOf(check.signed_ms), checkList(check, totals, unread > 0))),
      section('Faults by component', counted(Object.values(components).reduce((sum, one) => sum + one, 0), 'alarm'), bars(components)),
      section('Last drives', drives.length > SHOWN ? `${SHOWN} of ${totals.drives}` : '', driveList(drives.slice(0, SHOWN))));
  }

  #drawPlots() {
    const weeks = this.#answer?.weeks ?? [];
    const width = Math.floor(this.plots.clientWidth) - 32;
    if (!weeks.length || width < 100) return this.plots.replaceChildren();
    this.plots.replaceChildren(
      plot('Interventions per 100 autonomous km', 'dots: weeks · line: median of 5', ratePlot(weeks, 'interventions', width), weeks.some(({ interventions }) => interventions !== null)),
      plot('Alarms per 100 km', 'hatched: no drive', ratePlot(weeks, 'alarms', width), weeks.some(({ alarms }) => alarms !== null)),
      plot('Distance by mode, km a week', 'solid autonomous · hollow manual · hatched not known', modesPlot(weeks, width), true));
    return undefined;
  }
}

/** @param {string} title @param {string} more @param {Node} drawing @param {boolean} isKnown */
function plot(title, more, drawing, isKnown) {
  return html('section', { class: 'lb-plot' }, html('h3', {}, title, html('span', {}, more)), isKnown ? drawing : html('p', { class: 'sub' }, 'not known in this time'));
}

const hours = (/** @type {number | undefined} */ s = 0) => fixed(s / 3600, s < 36e4 ? 1 : 0);

/** @param {string} title @param {string} end @param {Node} what */
const section = (title, end, what) => html('section', {}, html('h3', {}, title, html('span', {}, end)), what);

/** @param {Record<string, number>} components */
function bars(components) {
  const rows = Object.entries(components).slice(0, 12);
  if (!rows.length) return html('p', { class: 'sub' }, 'none');
  const most = Math.max(...rows.map(([, number]) => number));
  return html('ul', { class: 'lb-bars' }, ...rows.map(([name, number]) => {
    const meter = html('progress', { max: most, value: number, 'aria-hidden': 'true' });
    return html('li', {}, html('span', { dir: 'auto' }, ...textNodes(name)), meter, html('b', { class: 'n' }, String(number)));
  }));
}

/** Nothing here is complete before all is read. @param {Answer} answer */
const unreadWords = ({ unread = 0 }) => (unread ? [`${counted(unread, 'recording')} ${unread === 1 ? 'is' : 'are'} still being read and not counted here.`] : []);

/** What stands since the newest signed check; of all drives, whatever the filters say. @param {Check} check @param {Answer['totals']} totals of the drives that are shown @param {boolean} isPartial recordings are yet to be read */
function checkList({ signed_ms, by, failed, failed_items, distance_m, unmeasured = 0, drives, not_known }, { checks_known, checks_missing }, isPartial) {
  const isLeast = isPartial || unmeasured > 0;
  const way = distance_m === null ? 'distance not known' : `${isLeast ? 'at least ' : ''}${fixed(distance_m / 1000, distance_m < 1e5 ? 1 : 0)} km`;
  const unsure = not_known ? `${not_known} of them may have had one: their recordings do not say` : '';
  const rows = signed_ms === null ? [['Signed', isPartial ? 'not known yet' : 'in no drive of this car', unsure]] : [
    ['Signed', daysAgo(signed_ms), by ? `by ${by}` : ''],
    ['Driven since', way, `with the drive it was made for${unmeasured ? `; the distance of ${counted(unmeasured, 'drive')} is not known` : ''}`],
    ['Drives since without one', `${isPartial ? 'at least ' : ''}${drives}`, drives ? unsure : ''],
    ['Failed in it', failed ? counted(failed, 'item') : 'none', failed_items.join(', ')],
  ];
  if (checks_known) rows.push(['Drives shown without one', String(checks_missing), `of ${counted(checks_known, 'drive')}`]);
  return html('dl', { class: 'lb-check' }, ...rows.map(([title = '', value = '', more = '']) => html('div', {}, html('dt', {}, title), html('dd', {}, html('b', {}, value), ...(more ? [html('small', { dir: 'auto' }, ...textNodes(more))] : [])))));
}

/** @param {import('./due.js').Due} due */
const isOverdue = ({ is_overdue }) => is_overdue;

/** Of the items that have an interval; null: none has. @param {Check[]} checks */
function overdueFigure(checks) {
  const all = checks.flatMap(({ recurring = [] }) => recurring);
  const late = all.filter(isOverdue).length;
  return all.length ? figure('Checks overdue', String(late), '', `of ${all.length}`, late > 0) : null;
}

/** The most late one first. @param {import('./due.js').Due[]} recurring */
function dueList(recurring) {
  return html('ul', { class: 'lb-due' }, ...recurring.map((due) => html('li', { 'data-overdue': due.is_overdue || null }, icon(due.is_overdue ? 'warn' : 'ok'),
    html('b', { dir: 'auto' }, ...textNodes(due.title)), html('span', { class: 'end' }, ...textNodes(dueWords(due))), html('small', {}, ...textNodes([intervalWords(due), lastWords(due)].filter(Boolean).join(' · '))))));
}

/** In whole days of this clock. @param {number} at_ms */
function daysAgo(at_ms) {
  const days = Math.floor((new Date().setHours(0, 0, 0, 0) - new Date(at_ms).setHours(0, 0, 0, 0)) / 86_400_000 + 0.5);
  return days < 1 ? 'today' : days === 1 ? 'yesterday' : `${days} days ago`;
}

/** @param {Drive[]} drives */
function driveList(drives) {
  return html('ul', { class: 'lb-drives' }, ...drives.map((drive) => html('li', {},
    html('a', { href: keptAt(`/api/recordings/${encodeURIComponent(drive.id)}/report`), target: '_blank', rel: 'noopener' },
      html('b', {}, dayOf(drive.started_ms)), html('span', { dir: 'auto' }, ...textNodes(drive.title || drive.people.join(', '))),
      html('span', { class: 'n' }, drive.distance_m === null ? '–' : `${fixed(drive.distance_m / 1000, 2)} km`),
      html('small', {}, ...textNodes(driveWords(drive)))))));
}

/** @param {Drive} drive */
function driveWords({ distance_m, modes_m, interventions, undescribed, alarms, marks, departure }) {
  const share = interventions !== null && distance_m ? `${(100 * (modes_m['autonomous'] ?? 0) / distance_m).toFixed(0)} % autonomous` : 'mode not known';
  return [share, ...(interventions === null ? [] : [counted(interventions, 'intervention') + (undescribed ? ` (${undescribed} not described)` : '')]), ...(marks ? [counted(marks, 'mark')] : []), alarms === null ? 'alarms not known' : counted(alarms, 'alarm'), ...(departure === null ? [] : [CHECKS[departure]])].join(' · ');
}
