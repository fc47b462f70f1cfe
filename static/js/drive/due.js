// When an item of the departure check that has an interval is due again: the texts, and the request to the logbook.

import { request } from '../control/request.js';
import { counted, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').LogbookDue} Due
 * @typedef {import('../core/protocol-types.js').LogbookAnswer} Answer
 */

/** An answer that takes longer is none [ms]. */
const ANSWER_MS = 10_000;

/** "every 30 days or 500 km"; "": at each departure. @param {{every_days: number | null, every_km: number | null}} item */
export function intervalWords({ every_days, every_km }) {
  const parts = [every_days === null ? '' : every_days === 1 ? 'day' : counted(every_days, 'day'), every_km === null ? '' : `${kilometres(every_km)} km`].filter(Boolean);
  return parts.length ? `every ${parts.join(' or ')}` : '';
}

/** "12 days and 41 km late", "due in 9 days or 120 km". @param {Due} due */
export function dueWords({ done_ms, due_days, due_km, every_km, is_overdue }) {
  if (done_ms === null) return 'never done';
  const days = due_days === null ? '' : counted(Math.abs(due_days), 'day');
  const way = due_km === null ? '' : `${kilometres(Math.abs(due_km))} km`;
  if (is_overdue) return `${[due_days !== null && due_days < 0 ? days : '', due_km !== null && due_km < 0 ? way : ''].filter(Boolean).join(' and ')} late`;
  const left = [due_days === 0 ? 'less than a day' : days, way].filter(Boolean).join(' or ');
  const unknown = every_km !== null && due_km === null ? 'distance not known' : '';
  return [left && `due in ${left}`, unknown].filter(Boolean).join(', ');
}

/** When it was done last. @param {Due} due */
export function lastWords({ done_ms, is_least }) {
  if (done_ms === null) return '';
  const day = new Date(done_ms).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });
  return `last ${day}${is_least ? '; it was driven farther than is known' : ''}`;
}

/** @param {number} value */
const kilometres = (value) => fixed(value, value < 100 && value % 1 ? 1 : 0);

/** The due dates of one car's items, as the logbook has them; requested once. */
export class DueItems {
  /** @type {Map<string, Due>} */
  #found = new Map();
  #vehicle = '';

  /** @param {() => void} onFound */
  constructor(onFound) {
    this.onFound = onFound;
  }

  /** @param {string} vehicle @param {{every_days: number | null, every_km: number | null}[]} items */
  want(vehicle, items) {
    if (vehicle === this.#vehicle || !items.some((one) => intervalWords(one))) return;
    this.#vehicle = vehicle;
    this.#found.clear();
    void this.#load(vehicle);
  }

  /** The second line of an item: its interval, and when it is due. @param {{id: string, every_days: number | null, every_km: number | null}} item */
  words(item) {
    const due = this.#found.get(item.id);
    return [intervalWords(item), due ? dueWords(due) : ''].filter(Boolean).join(', ');
  }

  /** The interval alone is shown where the logbook does not answer. @param {string} vehicle */
  async #load(vehicle) {
    const query = new URLSearchParams({ vehicle, from: String(Date.now()) }); // of the drives only what is due
    try {
      const { checks } = /** @type {Answer} */ (await request(`/api/logbook?${query}`, { signal: AbortSignal.timeout(ANSWER_MS) }));
      if (vehicle !== this.#vehicle) return;
      for (const due of checks.flatMap(({ recurring = [] }) => recurring)) this.#found.set(due.item, due);
      this.onFound();
    } catch {
      // its interval stands there
    }
  }
}
