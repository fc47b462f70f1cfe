// The departure check, in words and places: pure functions of what the server answered.

import { counted, fixed, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').DepartureAnswer} Departure
 * @typedef {import('../core/protocol-types.js').DepartureItem} Item
 * @typedef {'now' | 'failed' | 'open' | 'done' | 'not_applicable'} Face now: an active item that is looked at
 */

/** Chips of why an item is not applicable, and of why it failed. */
export const REASONS = /** @type {const} */ ({
  not_applicable: ['Not due yet', 'Not fitted to this car', 'Not needed for this drive', 'Seen by somebody else', 'Broken, reported'],
  failed: ['Broken', 'Missing', 'Not in order', 'Not possible to look at'],
});

/** The item that is to be done next: an active one before one that a person ticks. @param {Departure} departure */
export function nextOf({ items, state }) {
  if (state !== 'open') return null;
  const open = items.filter(({ result }) => result === 'open');
  return open.find(({ group, need, now }) => group === 'active' && need !== null && now !== null) ?? open.find(({ group }) => group === 'manual') ?? open[0] ?? null;
}

/** @param {Item} item @param {Item | null} next @returns {Face} */
export function faceOf(item, next) {
  if (item.result !== 'open') return item.result;
  return item.id === next?.id && item.group === 'active' ? 'now' : 'open';
}

const ORDER = /** @type {Record<Face, number>} */ ({ now: 0, failed: 1, open: 2, done: 3, not_applicable: 3 });

/** In the order of the screen: what is done now, failed, open, and what turned, the newest first. @param {Departure} departure @returns {[Item, Face][]} */
export function rowsOf(departure) {
  const next = nextOf(departure);
  const rows = departure.items.map((item) => /** @type {[Item, Face]} */ ([item, faceOf(item, next)]));
  return rows.sort(([a, of], [b, to]) => ORDER[of] - ORDER[to] || (ORDER[of] === 3 && departure.state === 'open' ? (b.at_ms ?? 0) - (a.at_ms ?? 0) : 0));
}

/** @param {Departure} departure */
export function doneOf({ done, not_applicable, of }) {
  return `${done + not_applicable} of ${of}`;
}

/** What is left before it can be signed; "": nothing. @param {Departure} departure */
export function leftWords({ done, failed, not_applicable, of }) {
  const open = of - done - failed - not_applicable;
  return [failed ? `${failed} failed` : '', open ? `${open} open` : ''].filter(Boolean).join(', ');
}

/** @param {Departure} departure */
export function countWords({ done, not_applicable, items, signature }) {
  const fixed_ = signature?.fixed ?? items.filter(({ is_fixed, result }) => is_fixed && result === 'done').length;
  return [`${done} done`, not_applicable ? `${not_applicable} not applicable` : '', fixed_ ? `${fixed_} fixed` : ''].filter(Boolean).join(', ');
}

/** What an item needs, before it is there. @param {Item} item */
export function needWords({ kind, need, unit, of }) {
  const amount = need === null ? '' : `${plain(need)} ${unit}`;
  switch (kind) {
    case 'manual': return 'by hand: press when done';
    case 'check': return 'by itself: its check is OK';
    case 'topic': return `by itself: ${of} at ${amount} or more`;
    case 'recorder': return 'by itself: recording is on';
    case 'sound': return `by itself: on ${counted(need ?? 1, 'phone')} or more`;
    case 'disk': return `by itself: ${amount} or more`;
    case 'clock': return `by itself: differs ${amount} at most`;
    case 'steering': return `do and see: ${plain(need ?? 0)}° left, then ${plain(need ?? 0)}° right`;
    case 'slow_down': return `do and see: arm, slide, 0 m/s held ${amount}`;
    default: return `do and see: ${amount} or more, once`;
  }
}

const HOW = /** @type {const} */ ({ manual: 'by hand', automatic: 'by itself', active: 'seen' });

/** The second line of a row. @param {Item} item @param {string} [due] of one that has an interval */
export function lineWords(item, due = '') {
  const { result, value, note, by, at_ms, group, is_fixed } = item;
  const at = at_ms === null ? '' : timeOfDay(at_ms);
  switch (result) {
    case 'not_applicable': return `not applicable: ${REASONS.not_applicable.some((one) => one === note) ? note.charAt(0).toLowerCase() + note.slice(1) : note}`;
    case 'done': {
      const what = group === 'active' ? `seen: ${value} at ${at}` : [`${HOW[group]}${value ? `: ${value}` : ''}`, at && !value ? at : ''].filter(Boolean).join(', ');
      return `${what}${group === 'manual' && by ? `, ${by}` : ''}${is_fixed ? `, fixed ${at}` : ''}`;
    }
    case 'failed': return note || value;
    default: return [group === 'automatic' && value ? value : needWords(item), due].filter(Boolean).join(' · ');
  }
}

/** Value and allowed value at the head of a failed one. @param {Item} item @returns {[string, string]} */
export function failedWords({ title, value, note, need, unit, kind }) {
  const amount = need === null ? '' : kind === 'sound' ? counted(need, 'phone') : `${plain(need)} ${unit}`;
  return [`${title}: ${(note || value).replace(/\.$/, '')}`, amount ? `${amount} ${kind === 'clock' ? 'allowed' : 'needed'}` : ''];
}

/** "20", "0.2": what is not needed is left out. @param {number} value */
export function plain(value) {
  return String(Math.round(value * 100) / 100);
}

/** The bar of an active item: places in percent of its width, from 0 or the middle. @param {Item} item */
export function barOf({ kind, need, now, peak }) {
  const least = need ?? 1;
  const isSteering = kind === 'steering';
  const high = isSteering ? least * 3 : kind === 'slow_down' ? least * 2 : 100;
  const low = isSteering ? -high : 0;
  const place = (/** @type {number} */ value) => Math.round(1000 * Math.min(1, Math.max(0, (value - low) / (high - low)))) / 10;
  const shown = now === null ? null : isSteering ? -now : now; // left is drawn on the left
  const steps = isSteering ? [low, -least, 0, least, high] : kind === 'slow_down' ? [0, least, high] : [0, 20, 40, 60, 80, 100];
  return {
    from: place(Math.min(0, shown ?? 0)), to: place(Math.max(0, shown ?? 0)),
    needs: (isSteering ? [-least, least] : [least]).map(place),
    peak: peak === null || peak <= 0 ? null : place(peak),
    ticks: steps.map((value) => ({ at: place(value), text: plain(Math.abs(value)) })),
  };
}

/** The large value of an active item. @param {Item} item @returns {[string, string]} number and unit */
export function valueOf({ kind, now, unit }) {
  if (now === null) return ['–', unit];
  if (kind === 'steering') return [fixed(Math.abs(now)), `${unit} ${now > 0.05 ? 'left' : now < -0.05 ? 'right' : ''}`.trim()];
  return [fixed(now, kind === 'slow_down' ? 1 : 0), unit];
}

/** @typedef {{label: string, does: 'record' | 'sound' | 'check' | 'signals' | 'files' | 'slow'}} Fix */

/** The key that fixes a failed item, or leads to where it is fixed. @param {Item} item @returns {Fix | null} */
export function fixOf({ kind }) {
  switch (kind) {
    case 'recorder': return { label: 'Start recording', does: 'record' };
    case 'sound': return { label: 'Arm sound', does: 'sound' };
    case 'check': return { label: 'Show the check', does: 'check' };
    case 'topic': return { label: 'Show signals', does: 'signals' };
    case 'disk': return { label: 'Open Files', does: 'files' };
    default: return null;
  }
}

/** A hash as it is read aloud: its first eight digits. @param {string} hash */
export function shortHash(hash) {
  return `${hash.slice(0, 4)} ${hash.slice(4, 8)}`;
}

/** The state of the check in a few words, for a key that leads to it. @param {import('../core/protocol-types.js').DepartureState | undefined} state */
export function stateWords(state) {
  if (!state || state.state === 'none') return 'Departure check: not begun';
  if (state.state === 'signed') return `Departure check: signed by ${state.by}`;
  return `Departure check: ${state.done + state.not_applicable} of ${state.of}${state.failed ? `, ${state.failed} failed` : ''}`;
}

/** @typedef {{id: string, title: string, kind: Item['kind'], of?: string, need?: number | null, fix?: string, every_days?: number | null, every_km?: number | null}} ListRow one item as it stands in the file */

/** @param {Item} item @returns {ListRow} */
export function rowOf({ id, title, kind, of, need, fix, every_days, every_km }) {
  return { id, title, kind, of, need, fix, every_days, every_km };
}

/** Whether two lists say the same. @param {ListRow[]} rows @param {ListRow[]} others */
export const isSame = (rows, others) => JSON.stringify(rows) === JSON.stringify(others);

/** The list with one more item by hand, under an id of its own. @param {ListRow[]} rows @param {string} title @returns {ListRow[]} */
export function added(rows, title) {
  const base = title.normalize('NFKD').toLowerCase().replace(/[^a-z0-9]+/g, '_').replace(/^_+|_+$/g, '').slice(0, 34) || 'item';
  let id = base;
  for (let n = 2; rows.some((row) => row.id === id); n += 1) id = `${base}_${n}`;
  return [...rows, { id, title: title.trim(), kind: 'manual' }];
}

/** The list with one item a place further up (−1) or down (1). @param {ListRow[]} rows @param {string} id @param {-1 | 1} by */
export function moved(rows, id, by) {
  const found = [...rows];
  const from = found.findIndex((row) => row.id === id);
  const [one, other] = [found[from], found[from + by]];
  if (!one || !other) return found;
  found[from] = other;
  found[from + by] = one;
  return found;
}
