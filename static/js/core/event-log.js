// The numbered log of alarm events: each exactly once, in order, and what happened while the page was blind.

/**
 * @typedef {import('./protocol-types.js').LogEvent} AlarmEvent
 * @typedef {import('./protocol-types.js').Resumed} Resumed
 * @typedef {{blind_s: number, raised: number, cleared: number, at_ms: number, unseen_m?: number | null}} Gap unseen_m: how far the car may have driven, once the first values came; null: not known
 * @typedef {{event: AlarmEvent, gap: null} | {event: null, gap: Gap}} Row
 */

const KEPT = 500; // rows; the server has the whole log
const LEFT = 2000; // events that another log did not have: they are not announced again where they come back
const PAST = 50; // events of before this page that its log begins with

export class EventLog {
  /** @type {Row[]} newest first */
  rows = [];
  /** @type {number | null} the last number this page has; null before the first greeting */
  last = null;
  /** The run of the server that it is of. @type {string | null} */
  #boot = null;
  /** The run that greeted, until it states where its log continues for this page. @type {string | null} */
  #joining = null;
  /** What this page had of logs that it left, oldest first, and the moment of the newest; events after a number are new in the present log. */
  #left = { events: /** @type {Set<string>} */ (new Set()), newest_ms: -Infinity, new_after: 0 };
  /** @type {{until: number, gap: Gap} | null} what is being caught up with */
  #blind = null;
  /** The gap after which no values came yet. @type {Gap | null} */
  open = null;
  /** How many gaps got their metres. */
  measured = 0;

  /**
   * The server greeted: it has events up to `last_event`. Answers the number from which this page wants them; it is of `boot`.
   * @param {{boot: string, last_event: number, resumes?: boolean}} hello
   * @param {number} blind_s how long nothing fresh had come before this greeting; 0 for the first
   * @param {number} at_ms wall clock
   * @returns {number}
   */
  greet({ boot, last_event, resumes }, blind_s, at_ms) {
    if (this.last === null) {
      this.#boot = boot;
      this.last = Math.max(0, last_event - PAST); // something to read in the log; it is past and not announced
      return this.last;
    }
    this.#joining = resumes && boot !== this.#boot ? boot : null;
    if (this.#joining === null) {
      if (boot !== this.#boot && last_event < this.last) this.last = this.#left.new_after = 0; // a server of before, that lost its log
      this.#boot = boot;
    }
    const gap = this.#blind?.gap ?? { blind_s, raised: 0, cleared: 0, at_ms }; // one whose events were still to come goes on
    gap.blind_s = Math.max(gap.blind_s, blind_s);
    this.open = gap;
    this.#blind = { until: last_event, gap };
    return this.last;
  }

  /** The log of the run that greeted is this page's up to a number; what the page has beyond is not in it. @param {Resumed} resumed */
  #join({ common, new_after }) {
    const known = this.rows.flatMap(({ event }) => event ?? []);
    this.rows = this.rows.filter(({ event }) => event === null || event.n <= common);
    const left = [...this.#left.events, ...known.filter(({ n }) => n > common).map(contentOf).reverse()].slice(-LEFT);
    this.#left = { events: new Set(left), newest_ms: Math.max(this.#left.newest_ms, ...known.map(({ at_ms }) => at_ms)), new_after };
    this.last = common;
    this.#boot = this.#joining;
    this.#joining = null;
  }

  /** Whether this page never had the event, by whatever number. @param {AlarmEvent} event */
  #isNew(event) {
    const { events, newest_ms, new_after } = this.#left;
    return (event.n > new_after || event.at_ms >= newest_ms) && !events.has(contentOf(event));
  }

  /** Forget everything: what comes is of another car. */
  clear() {
    this.rows = [];
    this.last = this.#boot = this.#joining = this.#blind = this.open = null;
    this.#left = { events: new Set(), newest_ms: -Infinity, new_after: 0 };
  }

  /** The first values after a gap came. @param {number | null} unseen_m the most that the car can have driven since the last ones; null: not known */
  seen(unseen_m) {
    if (!this.open) return;
    this.open.unseen_m = unseen_m;
    this.open = null;
    this.measured += 1;
  }

  /** What is kept, oldest first. */
  get events() {
    return this.rows.flatMap(({ event }) => event ?? []).reverse();
  }

  get boot() {
    return this.#boot;
  }

  /**
   * Take a batch; what is already here is dropped.
   * @param {AlarmEvent[]} events
   * @param {Resumed} [resumed]
   * @returns {AlarmEvent[]} those that are new, oldest first
   */
  take(events, resumed) {
    if (this.#joining !== null) {
      if (!resumed) return []; // they were sent before the server knew what this page has, and are sent again
      this.#join(resumed);
    }
    const following = events.filter((event) => event.n > (this.last ?? 0)).sort((a, b) => a.n - b.n);
    const fresh = following.filter((event) => this.#isNew(event));
    for (const event of following) {
      this.last = event.n;
      this.rows.unshift({ event, gap: null });
      if (this.#blind && event.n <= this.#blind.until && fresh.includes(event)) {
        if (event.change === 'raised' || event.change === 'recaused') this.#blind.gap.raised += 1;
        if (event.change === 'cleared') this.#blind.gap.cleared += 1;
      }
    }
    this.rows.length = Math.min(this.rows.length, KEPT);
    return fresh;
  }

  /**
   * The gap, once all that was missed is here; each gap once.
   * @returns {Gap | null}
   */
  caughtUp() {
    const blind = this.#blind;
    if (!blind || this.#joining !== null || (this.last ?? 0) < blind.until) return null;
    this.#blind = null;
    if (blind.gap.blind_s < 2) return null; // shorter than the veil: nothing was hidden from anyone
    this.rows.unshift({ event: null, gap: blind.gap });
    return blind.gap;
  }
}

/** An event without its number, which another log gave it. @param {AlarmEvent} event */
function contentOf({ at_ms, alarm, occurrence, change, text, by }) {
  return JSON.stringify([at_ms, alarm, occurrence, change, text, by]);
}

/**
 * "No data for 14 s; 2 alarms began, 1 ended".
 * @param {Gap} gap
 */
export function gapWords(gap) {
  const blind = gap.blind_s < 120 ? `${Math.round(gap.blind_s)} s` : `${Math.round(gap.blind_s / 60)} min`;
  if (!gap.raised && !gap.cleared) return `No data for ${blind}; no alarm began or ended`;
  return `No data for ${blind}; ${gap.raised} ${gap.raised === 1 ? 'alarm' : 'alarms'} began, ${gap.cleared} ended`;
}
