// The rows of all cars, the most urgent first, the fixed places of the grid, and the lines above them. Pure functions, no DOM.

import { rowsOf, shortNames } from './cars-layout.js';
import { ageOf, isLost, natural, silenceOf } from './fleet-layout.js';
import { age, counted, fixed, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').Cars} Cars
 * @typedef {import('../core/freshness.js').Ink} Freshness
 * @typedef {import('./fleet-layout.js').Item} Item
 * @typedef {import('./fleet-layout.js').Seen} Seen
 *
 * @typedef {object} Row one car, or many with one cause
 * @property {string} key
 * @property {string} name
 * @property {string[]} cars
 * @property {'crit' | 'warn' | 'unknown' | 'info' | 'ok' | 'link-off'} icon
 * @property {'crit' | 'warn' | ''} kind
 * @property {boolean} isAsking nobody has acknowledged it
 * @property {boolean} isLost nothing is known of it now
 * @property {string} text
 * @property {import('../core/link.js').ChainView} chain
 * @property {{ink: Freshness, value_mps: number | null}} speed
 * @property {'driving' | 'standing' | 'unknown'} mode
 * @property {string} operator
 * @property {string} recording
 * @property {boolean} isRecording
 * @property {{ink: Freshness, text: string}} energy
 * @property {string} age in seconds; a dash where it is not connected
 * @property {boolean} isQuiet nothing needs a person
 * @property {boolean} isStopped it is in a planned stop, which can be ended here
 *
 * @typedef {{kind: 'crit' | 'warn' | '', icon: string, text: string, end: string, more: string, isFilled: boolean}} Line more: left out where there is no room
 */

/** Slower is standing [m/s]: wheels turn a little where a car stands. */
const STANDS_MPS = 0.1;
/** From so many cars on, rows are low and each car has a place in the grid. */
export const MANY = 20;
export const MOST_ROWS = 16;

/** Nothing is known beyond the server; `cut` 0: nor of it. @param {0 | 1} [cut] @returns {import('../core/link.js').ChainView} */
const noChain = (cut = 1) => ({ state: 'Lost', age_s: null, cut, since_ms: null, nodes: [], sentence: '', detail: '' });

/**
 * @param {Seen} seen
 * @param {string[]} needing the cars in the queue, in its order: their rows come first
 * @param {import('./fleet-lost.js').Lost} silent what is lost, where nothing is known of any car
 * @returns {Row[]}
 */
export function carRows(seen, needing, silent) {
  const isSilent = silent !== null;
  const places = new Map(needing.map((name, i) => [name, i]));
  const listed = [...(seen.cars?.cars ?? [])].sort((a, b) => natural(a.name, b.name));
  const cars = seen.cars ? { ...seen.cars, cars: listed } : null;
  const byName = new Map(listed.map((car) => [car.name, car]));
  const rows = rowsOf(cars, seen.lag_s, seen.page).map((row) => {
    const car = /** @type {import('../core/protocol-types.js').ListedCar} */ (byName.get(row.name));
    const kept = seen.kept.get(row.name)?.summary ?? null;
    const lost = isSilent || isLost(car, seen.lag_s);
    const isOff = lost && Boolean(car.off);
    const isNew = lost && !isOff && silenceOf(car, seen) === null;
    const isCut = !lost && (car.summary?.link.cut != null || car.summary?.phase === 'lost');
    const ink = lost ? 'stale' : row.speed.ink;
    const value_mps = row.speed.value_mps ?? kept?.speed.value_mps ?? null;
    const percent = (lost ? kept : car.summary)?.energy_percent ?? null;
    const text = isSilent ? 'not known now' : isNew ? 'No data yet' : isOff ? 'Off on purpose' : lost ? 'No data' : row.worst ? row.text.replace(/, ([\d:.,]+ s|acknowledged)(?=$| \+)/, '') : row.icon === 'ok' ? '–' : row.text.replace(/:.*/, '');
    const owner = !lost && car.summary?.unowned ? 'owner off duty' : '';
    const stop = !lost && car.summary?.planned_stop ? 'planned stop' : '';
    const was = kept ? kept.holder : '';
    return {
      key: row.name, name: row.name, cars: [row.name],
      icon: isSilent || isNew ? 'unknown' : row.worst && isCut ? 'link-off' : row.icon,
      kind: isSilent || isNew ? '' : row.kind, isAsking: !isSilent && !isNew && row.kind !== '' && row.needs, isLost: lost && !isOff, text: owner || stop ? [text, owner, stop].filter((part) => part && part !== '–').join(' · ') : text,
      chain: (lost ? null : row.chain) ?? noChain(silent === 'server' ? 0 : 1), speed: { ink: value_mps === null ? 'never' : ink, value_mps },
      mode: modeOf(lost ? 'stale' : ink, row.speed.value_mps),
      operator: lost ? `${was ?? 'No one'}?` : row.operator,
      recording: lost ? 'not known' : row.recording, isRecording: !lost && /^\d/.test(row.recording),
      energy: { ink: /** @type {Freshness} */ (percent !== null && (lost || isCut) ? 'stale' : 'fresh'), text: fixed(percent, 0) },
      age: lost ? age(ageOf(car, seen.lag_s)) : row.age.replace(' s', ''), isQuiet: !places.has(row.name), isStopped: !lost && Boolean(car.summary?.planned_stop),
    };
  });
  if (isSilent) return rows.sort((a, b) => natural(a.name, b.name));
  const placeOf = (/** @type {Row} */ row) => places.get(row.name) ?? Infinity;
  return rows.sort((a, b) => (placeOf(a) === placeOf(b) ? 0 : placeOf(a) - placeOf(b)));
}

/** @param {string} ink @param {number | null} value_mps @returns {'driving' | 'standing' | 'unknown'} */
function modeOf(ink, value_mps) {
  if (value_mps === null || (ink !== 'fresh' && ink !== 'ageing')) return 'unknown';
  return Math.abs(value_mps) > STANDS_MPS ? 'driving' : 'standing';
}

/**
 * The rows with each flood as one; what was unfolded follows its row.
 * @param {Row[]} rows
 * @param {Map<string, Item>} folded
 * @param {Set<string>} unfolded
 * @returns {Row[]}
 */
export function foldedRows(rows, folded, unfolded) {
  /** @type {Row[]} */
  const shown = [];
  const seen = new Set();
  for (const row of rows) {
    const item = folded.get(row.key);
    if (!item) {
      shown.push(row);
      continue;
    }
    if (seen.has(item.key)) continue;
    seen.add(item.key);
    const all = rows.filter(({ key }) => folded.get(key) === item);
    const holders = new Set(all.map(({ operator }) => operator).filter((name) => name !== 'No one')).size;
    shown.push({
      ...row, key: item.key, name: item.name, cars: item.cars, text: `${item.title.replace(/[:,] cars.*/, '')}: ${item.detail}`,
      speed: { ink: 'fresh', value_mps: null }, energy: { ink: 'fresh', text: '–' }, mode: one(all.map(({ mode }) => mode)) ?? 'unknown',
      operator: one(all.map(({ operator }) => operator)) ?? counted(holders, 'person', 'people'), isRecording: all.every(({ isRecording }) => isRecording),
      recording: '', isStopped: false, chain: one(all.map(({ chain }) => chain.cut)) === undefined ? noChain() : row.chain,
    });
    if (unfolded.has(item.key)) shown.push(...all);
  }
  return shown;
}

/** What all of them are, or nothing. @template T @param {T[]} values */
function one(values) {
  return values.every((value) => value === values[0]) ? values[0] : undefined;
}

/**
 * The line under the bar: the most urgent item, or that nothing needs a person.
 * @param {Item[]} items of one car each
 * @param {Item[]} shown the same, with floods as one
 * @param {number} flood cars in floods
 * @param {Row[]} rows
 * @returns {Line}
 */
export function lineOf(items, shown, flood, rows) {
  const [first] = shown;
  if (first) {
    const free = items.filter(({ isUnassigned }) => isUnassigned).length;
    const whole = flood === first.cars.length ? 'flood' : `flood: ${flood}`; // its number stands in front
    const among = flood ? whole : shown.length > 1 ? `1 of ${shown.length}` : '';
    const unassigned = free ? `${free} unassigned` : '';
    const isLong = / may (move|be moving)$/.test(first.title); // on a phone this is read whole; the queue's head has the numbers
    const [end, more] = isLong ? ['', [among, unassigned].filter(Boolean).join(' · ')] : [among, among && unassigned ? `· ${unassigned}` : unassigned];
    return { kind: first.kind, icon: first.icon, text: `${first.name}: ${first.title}`, end, more, isFilled: first.isFilled };
  }
  if (!rows.length) return { kind: '', icon: 'unknown', text: 'No car is listed yet', end: '', more: '', isFilled: false };
  const off = rows.filter(({ icon }) => icon === 'unknown').length;
  return { kind: '', icon: off ? 'unknown' : 'ok', text: 'Nothing needs a person', end: off ? `${off} of ${rows.length} not monitored` : '', more: '', isFilled: false };
}

/** @param {number | null} heard_ms @param {boolean} isServer the server itself is silent @returns {Line} */
export function lostLine(heard_ms, isServer) {
  return { kind: 'crit', icon: 'link-off', text: isServer ? 'Server lost' : 'No data from any car', end: heard_ms === null ? '' : `since ${timeOfDay(heard_ms)}`, more: '', isFilled: true };
}

/** How many cars fit on a page of rows. @param {number} count of cars @param {number} height_px for rows, pager and what is below @param {number} row_px @param {number} below_px least of what is below */
export function rowsAPage(count, height_px, row_px, below_px) {
  const most = Math.min(MOST_ROWS, Math.floor((height_px - below_px) / row_px));
  return Math.max(4, Math.min(count, most));
}

/**
 * The fixed place of each car, and what stands there.
 * @param {Row[]} rows
 * @returns {{name: string, label: string, kind: 'crit' | 'warn' | 'lost' | '', isKnown: boolean, isDriving: boolean, title: string}[]} isKnown: its alarm stands, and was acknowledged
 */
export function placesOf(rows) {
  const sorted = [...rows].sort((a, b) => natural(a.name, b.name));
  const labels = labelsOf(sorted.map(({ name }) => name));
  return sorted.map((row, i) => {
    const kind = row.isLost || (row.kind !== '' && row.icon === 'link-off') ? 'lost' : row.kind;
    const state = row.isLost ? 'no data' : row.text === '–' ? row.mode : row.text;
    return { name: row.name, label: labels[i] ?? row.name, kind, isKnown: row.kind !== '' && !row.isAsking, isDriving: row.mode === 'driving', title: `${row.name}, ${state}` };
  });
}

/** Numbers alone where all names are one term and a number. @param {string[]} names */
export function labelsOf(names) {
  const parts = names.map((name) => /^(\D*)(\d{1,4})$/.exec(name));
  if (names.length > 1 && parts.every((part) => part && part[1] === parts[0]?.[1])) return parts.map((part) => part?.[2] ?? '');
  const short = shortNames(names);
  return names.map((name) => short.get(name) ?? name.slice(0, 8));
}

