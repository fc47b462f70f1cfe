// Older events of the alarm log than the page has: requested from the server in batches, with the filter of the log.

import { rankedEvents } from '../core/priority.js';
import { filterParams, lowest } from './log-layout.js';

const BATCH = 100; // events a request

/** @typedef {import('../core/protocol-types.js').LogEvent} AlarmEvent */

/** The query of a request for events that fit a filter. @param {import('./log-layout.js').Filter} filter @param {Record<string, string>} [more] */
export function queryOf(filter, more = {}) {
  const vehicle = document.documentElement.dataset['vehicle'];
  return new URLSearchParams({ ...(vehicle ? { vehicle } : {}), ...more, ...filterParams(filter) });
}

export class OlderEvents {
  /** @type {AlarmEvent[]} */
  events = [];
  /** The number before which there are more; null: none, undefined: not requested yet. @type {number | null | undefined} */
  next = undefined;
  isBusy = false;
  /** What to say about the last request. */
  note = '';
  /** Counts the filters: an answer to the request of an earlier one is dropped. */
  #filters = 0;

  /** @param {() => void} onChange */
  constructor(onChange) {
    this.onChange = onChange;
  }

  /** Drops everything, because the filter changed or the log is closed. */
  clear() {
    this.#filters += 1;
    this.events = [];
    this.next = undefined;
    this.isBusy = false;
    this.note = '';
  }

  /** @param {import('./log-layout.js').Filter} filter @param {import('../core/event-log.js').Row[]} rows what the page has */
  async fetch(filter, rows) {
    if (this.isBusy) return;
    const mine = this.#filters;
    this.isBusy = true;
    this.onChange();
    const before = this.next ?? lowest(rows);
    const query = queryOf(filter, { limit: String(BATCH), ...(before === null ? {} : { before: String(before) }) });
    /** @type {{events: AlarmEvent[], next_before: number | null} | null} */
    let found = null;
    try {
      const answer = await fetch(`/api/log?${query}`, { cache: 'no-store' });
      const { events, next_before } = await answer.json();
      if (answer.ok) found = { events: rankedEvents([...events]), next_before };
    } catch {
      // no answer
    }
    if (mine !== this.#filters) return;
    this.isBusy = false;
    if (found) {
      this.events = [...this.events, ...found.events];
      this.next = found.next_before;
    }
    this.note = !found ? 'The server did not give older events. Try again.'
      : found.next_before === null ? 'This is the beginning of the log.' : found.events.length ? '' : 'Nothing among the last 2000 events; older ones may fit.';
    this.onChange();
  }
}
