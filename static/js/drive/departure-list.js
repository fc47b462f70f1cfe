// The list of the departure check in Settings: add, change, remove, reorder, and back to the one of the vehicle profile.

import { decimalOf, local } from '../core/decimal.js';
import { added, isSame, moved, rowOf } from './departure-layout.js';
import { styled } from '../core/style-sheet.js';
import { request, sentenceOf } from '../control/request.js';
import { html, icon, listen, setText, setSentence, show } from '../core/dom.js';
import { counted } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').DepartureAnswer} Departure
 * @typedef {import('../core/protocol-types.js').DepartureKindRow} Kind
 * @typedef {import('./departure-layout.js').ListRow} ListRow
 * @typedef {{element: HTMLElement, row: ListRow, fill: (row: ListRow) => void}} Made an item as it stands there
 */

/** An answer that takes longer is none [ms]. */
const ANSWER_MS = 5000;

/**
 * Nothing can be changed before the list is known: one that does not load is an error of the caller's.
 * @param {HTMLElement} place
 * @param {import('../core/store.js').Store} store
 * @param {(words: string) => void} head shows at the group's head what holds
 */
export async function mount(place, store, head) {
  await styled('departure');
  const { vehicle } = store;
  new DepartureList(place, store, head, vehicle, await load(vehicle));
}

class DepartureList {
  /** @type {ListRow[]} */
  #rows = [];
  /** @type {Kind[]} */
  #kinds = [];
  /** What stands there, by the id of the item. @type {Map<string, Made>} */
  #made = new Map();
  /** One change after the other, each of the list that the one before made. @type {Promise<unknown>} */
  #sent = Promise.resolve();

  /** @param {HTMLElement} place @param {import('../core/store.js').Store} store @param {(words: string) => void} head @param {string} vehicle whose list it is @param {Departure} departure */
  constructor(place, store, head, vehicle, departure) {
    this.store = store;
    this.vehicle = vehicle;
    this.head = head;
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.list = html('ol', { class: 'dep-edit', 'aria-label': 'Items of the departure check' });
    this.name = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: 60, autocomplete: 'off', 'aria-label': 'Title of one more item', placeholder: 'One more item' }));
    const form = html('form', { class: 'keys' }, html('div', { class: 'field' }, this.name), html('button', { type: 'submit', class: 'key wide', 'data-f': 'departure-add' }, icon('plus'), 'Add'));
    this.back = html('button', { type: 'button', class: 'key wide', 'data-f': 'departure-default' }, 'Use the list of the vehicle profile');
    this.file = html('a', { class: 'key wide', download: '', 'data-f': 'departure-file', href: path(vehicle, '.toml') }, 'Save as a file');
    place.replaceChildren(this.bad, this.list, ...(store.isViewer ? [] : [form, html('div', { class: 'keys' }, this.back)]), html('div', { class: 'keys' }, this.file));
    listen(form, 'submit', (event) => {
      event.preventDefault();
      void this.#send((rows) => added(rows, this.name.value)).then((isDone) => { if (isDone) this.name.value = ''; });
    });
    listen(this.back, 'click', () => void this.#send(() => null));
    this.#take(departure);
  }

  /** @param {Departure} departure */
  #take(departure) {
    this.#kinds = departure.kinds;
    this.#rows = departure.items.map(rowOf);
    this.head(`${counted(this.#rows.length, 'item')}${departure.is_default ? '' : ', changed'}`);
    setText(this.bad, departure.complaint ?? '');
    show(this.back, !departure.is_default || departure.complaint !== null);
    const had = this.#made;
    this.#made = new Map(this.#rows.map((row) => {
      const made = had.get(row.id);
      const isSame = made?.row.kind === row.kind && made.row.title === row.title;
      if (isSame) made.fill(row);
      return [row.id, isSame ? made : this.#row(row)];
    }));
    const elements = [...this.#made.values()].map(({ element }) => element);
    if (elements.some((element, i) => this.list.children[i] !== element) || this.list.children.length !== elements.length) this.list.replaceChildren(...elements);
  }

  /** @param {ListRow} row @returns {Made} */
  #row(row) {
    const about = this.#kinds.find(({ kind }) => kind === row.kind);
    const isLocked = this.store.isViewer;
    const title = input('Title', row.title, row.title, 60);
    const kind = /** @type {HTMLSelectElement} */ (html('select', { 'aria-label': `Kind of ${row.title}` }, ...this.#kinds.map((one) => html('option', { value: one.kind }, one.title))));
    kind.value = row.kind;
    const fix = input('What to do if it fails', row.title, row.fix ?? '', 300);
    const ofWhat = about?.of ? input(about.of === 'check' ? 'Id of the check' : 'Name of the topic', row.title, row.of ?? '', 200) : null;
    const need = about?.need === null || !about ? null : input(`Needed ${about.unit}`, row.title, local(String(row.need ?? about.need)), 10);
    const days = input('Days', `how often, ${row.title}`, row.every_days ? String(row.every_days) : '', 5);
    const way = input('Kilometres', `how often, ${row.title}`, row.every_km ? local(String(row.every_km)) : '', 8);
    const change = (/** @type {Partial<ListRow>} */ part) => void this.#send((rows) => rows.map((one) => (one.id === row.id ? { ...one, ...part } : one)));
    for (const [element, act] of /** @type {[HTMLInputElement | HTMLSelectElement | null, () => void][]} */ ([
      [title, () => change({ title: title.value })],
      [kind, () => change(this.#kindRow(row, /** @type {Kind['kind']} */ (kind.value)))],
      [fix, () => change({ fix: fix.value })],
      [ofWhat, () => change({ of: ofWhat?.value ?? '' })],
      [need, () => change({ need: numberIn(need) })],
      [days, () => change({ every_days: days.value.trim() ? numberIn(days) : null })],
      [way, () => change({ every_km: way.value.trim() ? numberIn(way) : null })],
    ])) {
      if (!element) continue;
      element.disabled = isLocked;
      if (!isLocked) element.addEventListener('change', act);
    }
    const key = (/** @type {string} */ name, /** @type {string} */ label, /** @type {(rows: ListRow[]) => ListRow[]} */ alter, /** @type {string} */ kindOf) => {
      const made = html('button', { type: 'button', class: `key ${kindOf}`, 'aria-label': `${label} ${row.title}` }, icon(name));
      made.addEventListener('click', () => void this.#send(alter));
      return made;
    };
    const keys = isLocked ? [] : [key('next', 'Up:', (rows) => moved(rows, row.id, -1), 'up'), key('next', 'Down:', (rows) => moved(rows, row.id, 1), 'down'), key('trash', 'Remove', (rows) => rows.filter(({ id }) => id !== row.id), '')];
    const element = html('li', { 'data-id': row.id }, html('span', { class: 'field wide-field' }, title),
      html('div', { class: 'two' }, html('span', { class: 'field' }, kind), ...(need ? [html('span', { class: 'field' }, need, html('span', { class: 'u' }, about?.unit ?? ''))] : [])),
      ...(ofWhat ? [html('span', { class: 'field wide-field' }, ofWhat)] : []), html('span', { class: 'field wide-field' }, fix),
      html('div', { class: 'two every' }, html('span', { class: 'field' }, html('span', { class: 'u' }, 'every'), days, html('span', { class: 'u' }, 'days')), html('span', { class: 'field' }, html('span', { class: 'u' }, 'or'), way, html('span', { class: 'u' }, 'km'))), ...keys);
    const fields = /** @type {[HTMLInputElement | HTMLSelectElement | null, (of: ListRow) => string][]} */ ([[title, (of) => of.title], [kind, (of) => of.kind], [fix, (of) => of.fix ?? ''], [ofWhat, ({ of }) => of ?? ''], [need, (of) => local(String(of.need ?? ''))], [days, (of) => String(of.every_days ?? '')], [way, (of) => local(String(of.every_km ?? ''))]]);
    const made = { element, row, fill: (/** @type {ListRow} */ now) => {
      made.row = now;
      for (const [field, valueOf] of fields) if (field && field !== document.activeElement) field.value = valueOf(now); // not what is being typed
    } };
    return made;
  }

  /** Another kind needs something else. @param {ListRow} row @param {Kind['kind']} kind @returns {Partial<ListRow>} */
  #kindRow(row, kind) {
    const about = this.#kinds.find((one) => one.kind === kind);
    const of = about?.of === 'check' ? 'gps_fix' : about?.of === 'topic' ? this.store.signal('speed')?.topic ?? '/catvehicle/vel' : '';
    return { kind, of: about?.of ? of : '', need: about?.need ?? null, title: row.title };
  }

  /** @param {(rows: ListRow[]) => ListRow[] | null} changed null: the list of the vehicle profile @returns {Promise<boolean>} */
  #send(changed) {
    const sent = this.#sent.then(async () => {
      const why = await this.#whyNot(changed);
      if (why) setSentence(this.bad, why);
      return why === '';
    });
    this.#sent = sent;
    return sent;
  }

  /** The whole list is sent: only one that is known to be the newest is changed. @param {(rows: ListRow[]) => ListRow[] | null} changed @returns {Promise<string>} '': it was changed */
  async #whyNot(changed) {
    const { vehicle } = this;
    setText(this.bad, '');
    try {
      const now = await load(vehicle);
      if (!isSame(this.#rows, now.items.map(rowOf))) {
        this.#take(now);
        return 'Nothing was changed: somebody else changed the list meanwhile. Look at it, and change it again.';
      }
    } catch (error) {
      return `${sentenceOf(error)} Nothing was changed.`;
    }
    if (vehicle !== this.store.vehicle) return 'Nothing was changed: another car is shown now. Close this group and open it again.';
    const items = changed(this.#rows)?.map((row) => Object.fromEntries(Object.entries(row).filter(([, value]) => value !== '' && value !== null && value !== undefined))) ?? null;
    const answer = await this.store.ask('set_departure_list', { vehicle, items });
    try {
      this.#take(await load(vehicle));
    } catch (error) {
      return answer.ok ? sentenceOf(error) : answer.reason ?? 'Refused.';
    }
    return answer.ok ? '' : answer.reason ?? 'Refused.';
  }
}

/** @param {string} vehicle @returns {Promise<Departure>} */
const load = (vehicle) => request(path(vehicle), { signal: AbortSignal.timeout(ANSWER_MS) });

/** @param {string} vehicle @param {string} [as] */
function path(vehicle, as = '') {
  return `/api/departure${as}${vehicle ? `?vehicle=${encodeURIComponent(vehicle)}` : ''}`;
}

/** Not a number where it is none: the server's refusal names what it wants. @param {HTMLInputElement | null} field */
const numberIn = (field) => decimalOf(field?.value ?? '');

/** @param {string} label @param {string} of @param {string} value @param {number} longest */
function input(label, of, value, longest) {
  const made = /** @type {HTMLInputElement} */ (html('input', { type: 'text', maxlength: longest, autocomplete: 'off', 'aria-label': `${label}: ${of}`, placeholder: label }));
  made.value = value;
  return made;
}
