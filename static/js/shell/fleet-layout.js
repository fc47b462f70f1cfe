// The attention queue of all cars: what needs a person, in which order, who has it, and what may be done. Pure functions, no DOM.

import { titleOf } from '../alarms/alarm-title.js';
import { counted, duration, timeOfDay } from '../core/format.js';
import { ICONS, RANK } from '../core/priority.js';
import { requestItem, supervisorWords, unownedWords } from './fleet-requests.js';
import { speedWords } from '../core/units.js';

/**
 * @typedef {import('../core/protocol-types.js').Cars} Cars
 * @typedef {import('../core/protocol-types.js').ListedCar} ListedCar
 * @typedef {import('../core/protocol-types.js').CarSummary} CarSummary
 * @typedef {import('../core/protocol-types.js').CarAlarm} CarAlarm
 * @typedef {'open' | 'take' | 'over' | 'accept' | 'decline' | 'hand' | 'withdraw' | 'release' | 'hush' | 'off' | 'on' | 'show'} Act
 * @typedef {{act: Act, label: string, isMain: boolean}} Key
 * @typedef {{text: string, is: 'nobody' | 'you' | 'other' | 'unknown'}} Who
 * @typedef {{share: number, isUp: boolean}} Timer share: 0 … 1 of the time until the supervisor is called
 * @typedef {import('../core/protocol-types.js').FleetEvent} FleetEvent
 *
 * @typedef {object} Item what needs a person: of one car, or of many with one cause
 * @property {string} key
 * @property {string[]} cars
 * @property {string} name
 * @property {'crit' | 'warn' | 'info' | 'link-off'} icon
 * @property {'crit' | 'warn' | ''} kind
 * @property {boolean} isFilled active, and nobody has acknowledged it
 * @property {string} title
 * @property {string} detail
 * @property {number | null} since_s
 * @property {Who} who
 * @property {string} next what happens if nobody acts
 * @property {Timer | null} timer
 * @property {Key[]} keys
 * @property {number[]} order the smaller, the sooner
 * @property {string} cause cars with one cause are one item in a flood
 * @property {number} raised_s for so long
 * @property {boolean} isUnassigned
 * @property {boolean} [isUnowned] who has acknowledged an alarm of it is off duty
 * @property {boolean} [isOff] a person marked it as off on purpose: it is in no count
 * @property {import('../core/protocol-types.js').Sound} sound of an alarm that nobody has, or of a car that fell silent
 *
 * @typedef {object} Seen what the queue is made of
 * @property {Cars | null} cars
 * @property {number} lag_s age of the list at the glass
 * @property {number} now_ms the server's wall clock now; a car whose summary states a clock of its own has that
 * @property {Map<string, {summary: CarSummary, at_ms: number, timer_s?: number}>} kept
 * @property {number} page_ms this page's monotonic clock now
 * @property {number} wall_ms this page's wall clock now
 * @property {string} page
 * @property {Set<string>} [hushed] lost cars whose sound was silenced on this page
 */

/** A car whose summary is older is lost [s]. */
export const KNOWN_S = 3;
/** An unassigned critical item usually goes on to the supervisor after this time [s]; the car's session decides when. */
export const ESCALATES_S = 30;
/** More cars with one cause within this time are one item [s]. */
export const FLOOD_CARS = 10;
const FLOOD_S = 600;
/** So many events are kept. */
const EVENTS = 20;

const KIND = /** @type {const} */ ({ critical: 'crit', warning: 'warn', advisory: '' });
const LABELS = /** @type {Record<Act, string>} */ ({
  open: 'Open', take: 'Take it', over: 'Take over', accept: 'Accept', decline: 'Decline', hand: 'Hand over', withdraw: 'Withdraw', release: 'Unassign', hush: 'Silence', off: 'It is off', on: 'Not off', show: 'Show',
});

/** Age of what a car stated last, now [s]; null: it never stated anything. @param {ListedCar} car @param {number} lag_s */
export function ageOf(car, lag_s) {
  return car.age_s === null ? null : car.age_s + lag_s;
}

/** Nothing is known of the car now. @param {ListedCar} car @param {number} lag_s */
export function isLost(car, lag_s) {
  return !car.summary || (ageOf(car, lag_s) ?? Infinity) > KNOWN_S;
}

/**
 * Every item, the most urgent first.
 * @param {Seen} seen
 * @returns {Item[]}
 */
export function itemsOf(seen) {
  const items = [];
  for (const car of seen.cars?.cars ?? []) {
    const clock_ms = car.summary?.time_ms;
    const now_ms = clock_ms === undefined ? seen.now_ms : clock_ms + 1000 * (ageOf(car, seen.lag_s) ?? 0);
    const item = isLost(car, seen.lag_s) ? lostItem(car, seen) : itemOf(car.name, /** @type {CarSummary} */ (car.summary), { ...seen, now_ms });
    if (item) items.push(item);
    const request = isLost(car, seen.lag_s) ? null : requestItem(car.name, /** @type {CarSummary} */ (car.summary), ageOf(car, seen.lag_s) ?? 0);
    if (request) items.push(request);
  }
  return items.sort(byOrder);
}

/** @param {Item} a @param {Item} b */
function byOrder(a, b) {
  for (let i = 0; i < a.order.length; i += 1) {
    const less = (a.order[i] ?? 0) - (b.order[i] ?? 0);
    if (less !== 0) return less;
  }
  return natural(a.name, b.name);
}

const collator = new Intl.Collator('en', { numeric: true });

/** Names as people count: C2 before C10. @param {string} a @param {string} b */
export function natural(a, b) {
  return collator.compare(a, b);
}

/** @param {string} name @param {CarSummary} summary @param {Seen} seen @returns {Item | null} */
function itemOf(name, summary, seen) {
  const { attention, worst } = summary;
  const needs = attention === undefined ? worst !== null && worst.priority !== 'advisory' && worst.state !== 'SHELVED' : attention !== null;
  if (!needs) return null;
  const isCut = summary.link.cut !== null || summary.phase === 'lost';
  const isAsking = worst?.state === 'UNACKED' || worst?.state === 'RTN_UNACKED';
  const since_ms = attention?.since_ms ?? worst?.raised_ms ?? seen.now_ms;
  const raised_s = (seen.now_ms - (worst?.raised_ms ?? since_ms)) / 1000;
  const timer = timerOf(attention, seen.now_ms, seen.kept.get(name)?.timer_s ?? ESCALATES_S);
  const isUnassigned = attention !== undefined && !attention?.assigned;
  const more = summary.waiting > 1 ? `, ${counted(summary.waiting - 1, 'more alarm')}` : '';
  const text = isCut ? lastWords(summary.speed.value_mps, summary.link.car_age_s ?? summary.link.bridge_age_s, seen) : worst?.text ?? '';
  return {
    key: name, cars: [name], name, icon: isCut ? 'link-off' : worst ? ICONS[worst.priority] : 'info', kind: worst ? KIND[worst.priority] : 'warn',
    isFilled: Boolean(worst?.active && isAsking), title: `${worst ? titleOf(worst) : 'Needs a person'}${isCut ? ', car may move' : ''}`, detail: [`${text}${more}`.replace(/^, /, ''), unownedWords(summary)].filter(Boolean).join('; '),
    since_s: Math.max(0, (seen.now_ms - since_ms) / 1000),
    who: whoOf(summary, seen.page), next: nextOf(summary, seen.now_ms), timer, keys: keysOf(summary, seen),
    order: [...stepOf(summary, seen), -(worst ? RANK[worst.priority] : 0), raised_s],
    cause: worst?.id ?? '', raised_s, isUnassigned, isUnowned: Boolean(summary.unowned),
    sound: isUnassigned && worst?.state === 'UNACKED' ? worst.sound : 'none',
  };
}

/** For how long nothing was received of a car [s]; null: nothing ever was. @param {ListedCar} car @param {Seen} seen */
export function silenceOf(car, seen) {
  const kept = seen.kept.get(car.name);
  return ageOf(car, seen.lag_s) ?? (kept ? (seen.page_ms - kept.at_ms) / 1000 : null);
}

/** A car of which nothing is known now: who has it is not known either. A car without any data so far is only listed. @param {ListedCar} car @param {Seen} seen @returns {Item | null} */
function lostItem(car, seen) {
  const kept = seen.kept.get(car.name);
  const since_s = silenceOf(car, seen);
  if (car.off) return offItem(car.name, car.off, since_s, seen);
  if (since_s === null) return null;
  const had = kept?.summary.attention?.assigned?.name;
  const isLoud = kept?.summary.phase !== 'idle' && !seen.hushed?.has(car.name);
  return {
    key: car.name, cars: [car.name], name: car.name, icon: 'link-off', kind: 'crit', isFilled: true,
    title: 'No data: car may be moving',
    detail: [lastWords(kept?.summary.speed.value_mps ?? null, since_s, seen), car.trouble].filter(Boolean).join('. '),
    since_s, who: { text: had ? `assigned to ${had}?` : 'not known who has it', is: 'unknown' }, next: 'no timer', timer: null, keys: [key('open', true), ...(isLoud ? [key('hush')] : []), ...(car.trouble ? [key('off')] : [])],
    order: [2, 0, -3, -since_s], cause: ' lost', raised_s: since_s, isUnassigned: false, sound: isLoud ? 'high' : 'none',
  };
}

/** A car that is off on purpose, marked so by a person: it needs nobody until its data comes again. @param {string} name @param {import('../core/protocol-types.js').OffOnPurpose} off @param {number | null} since_s @param {Seen} seen @returns {Item} */
function offItem(name, { by, since_ms }, since_s, seen) {
  return {
    key: name, cars: [name], name, icon: 'info', kind: '', isFilled: false, title: 'Off on purpose', detail: lastWords(null, since_s, seen), since_s: Math.max(0, (seen.now_ms - since_ms) / 1000),
    who: { text: `set by ${by} at ${timeOfDay(since_ms)}`, is: 'other' }, next: 'until data comes', timer: null, keys: [key('on')],
    order: [9, 0, 0, 0], cause: '', raised_s: 0, isUnassigned: false, isOff: true, sound: 'none',
  };
}

/** @param {number | null} value_mps @param {number | null} ago_s @param {Seen} seen */
function lastWords(value_mps, ago_s, seen) {
  if (ago_s === null) return '';
  const at = timeOfDay(seen.wall_ms - ago_s * 1000);
  return value_mps === null ? `last data at ${at}` : `last ${speedWords(value_mps).join(' ')} at ${at}`;
}

/**
 * How long the timer of an item is [s]: what was left of it when it began here; where it ran already, the usual time.
 * @param {{summary: CarSummary, timer_s?: number} | undefined} before what the car stated before
 * @param {CarSummary} summary
 * @param {number} now_ms
 */
export function timerLength(before, { attention, time_ms }, now_ms) {
  const ends_ms = attention?.escalates_ms;
  if (ends_ms === null || ends_ms === undefined) return ESCALATES_S;
  if (before?.timer_s && before.summary.attention?.escalates_ms === ends_ms) return before.timer_s;
  const left_s = (ends_ms - (time_ms ?? now_ms)) / 1000;
  return before ? Math.max(1, left_s) : Math.max(ESCALATES_S, left_s);
}

/** @param {CarSummary['attention']} attention @param {number} now_ms @param {number} timer_s @returns {Timer | null} */
function timerOf(attention, now_ms, timer_s) {
  if (!attention) return null;
  if (attention.escalated_ms !== null) return { share: 1, isUp: true };
  if (attention.escalates_ms === null) return null;
  const left_s = (attention.escalates_ms - now_ms) / 1000;
  return { share: Math.min(1, Math.max(0, 1 - left_s / timer_s)), isUp: false };
}

/** @param {CarSummary} summary @param {number} now_ms */
function nextOf({ attention }, now_ms) {
  if (!attention) return '';
  const { offered } = attention;
  return supervisorWords(attention, now_ms) || (offered ? `offered ${duration((now_ms - offered.since_ms) / 1000)} ago` : 'no timer');
}

/** @param {CarSummary} summary @param {string} page @returns {Who} */
function whoOf({ attention, worst }, page) {
  if (attention === undefined) return { text: 'not known who has it', is: 'unknown' };
  const assigned = attention?.assigned;
  const offered = attention?.offered;
  if (offered?.page === page) return { text: `offered to you by ${offered.by}`, is: 'other' };
  const offer = offered ? `, offered to ${offered.name}` : '';
  if (!assigned) return { text: `unassigned${offer}`, is: 'nobody' };
  const isAcknowledged = worst?.state === 'ACKED';
  const isYou = assigned.page === page;
  return { text: `assigned to ${isYou ? 'you' : assigned.name}${isAcknowledged && !offer ? ', acknowledged' : ''}${offer}`, is: isYou ? 'you' : 'other' };
}

/** Escalated first, then by the time left; a question to this page before what nobody has, then what somebody has. @param {CarSummary} summary @param {Seen} seen @returns {[number, number]} */
function stepOf({ attention, worst, unowned }, seen) {
  if (attention && attention.escalated_ms !== null) return [0, attention.escalated_ms - seen.now_ms];
  if (attention && attention.escalates_ms !== null) return [1, attention.escalates_ms - seen.now_ms];
  if (attention?.offered?.page === seen.page) return [3, 0];
  return [attention?.assigned || (worst?.state === 'ACKED' && !unowned) ? 5 : 4, 0];
}

/** @param {Act} act @param {boolean} [isMain] @param {string} [label] @returns {Key} */
function key(act, isMain = false, label = LABELS[act]) {
  return { act, label, isMain };
}

/** @param {CarSummary} summary @param {Seen} seen @returns {Key[]} */
function keysOf({ attention }, { page }) {
  if (!attention) return [key('open', true)];
  const { assigned, offered } = attention;
  if (offered?.page === page) return [key('accept', true), key('decline')];
  if (assigned?.page === page) return offered ? [key('open', true), key('withdraw')] : [key('open', true), key('hand'), key('release')];
  return assigned ? [key('over')] : [key('take', true), key('hand')];
}

/**
 * The queue with each flood as one item; what was unfolded follows its item.
 * @param {Item[]} items in order
 * @param {Set<string>} unfolded keys of items that were unfolded
 * @returns {{items: Item[], folded: Map<string, Item>, flood: number}} folded: the item that stands for a car; flood: cars in floods
 */
export function grouped(items, unfolded) {
  /** @type {Map<string, Item[]>} */
  const causes = new Map();
  for (const item of items) {
    if (!item.cause || item.raised_s > FLOOD_S) continue;
    causes.set(item.cause, [...(causes.get(item.cause) ?? []), item]);
  }
  /** @type {Map<string, Item[]>} */
  const groups = new Map();
  for (const [cause, all] of causes) {
    if (all.length <= FLOOD_CARS) continue;
    for (const item of all) {
      if (item.keys.some(({ act }) => act === 'accept')) continue; // a question to this page is answered by itself
      const of = `flood ${cause} ${item.who.is === 'you'}`;
      groups.set(of, [...(groups.get(of) ?? []), item]);
    }
  }
  /** @type {Map<string, Item>} */
  const folded = new Map();
  /** @type {Item[]} */
  const shown = [];
  let flood = 0;
  for (const [of, all] of groups) {
    if (all.length < 2) continue;
    const one = groupOf(of, all, unfolded.has(of));
    flood += all.length;
    for (const item of all) folded.set(item.key, one);
  }
  for (const item of items) {
    const one = folded.get(item.key);
    if (!one) shown.push(item);
    else if (!shown.includes(one)) shown.push(one, ...(unfolded.has(one.key) ? items.filter((other) => folded.get(other.key) === one) : []));
  }
  return { items: shown, folded, flood };
}

/** @param {string} of @param {Item[]} all in order @param {boolean} isUnfolded @returns {Item} */
function groupOf(of, all, isUnfolded) {
  const [first] = /** @type {[Item]} */ (all);
  const names = all.map(({ name }) => name).sort(natural);
  const free = all.filter(({ isUnassigned }) => isUnassigned).length;
  const isLostCars = first.cause === ' lost';
  const isMine = first.who.is === 'you';
  const who = isLostCars || isMine ? first.who.text : free === all.length ? 'unassigned' : free ? `${free} of ${all.length} unassigned` : 'assigned to others';
  const show = key('show', isLostCars, isUnfolded ? `Hide ${all.length}` : `Show ${all.length}`);
  const keys = isLostCars ? (loudest(all) === 'none' ? [] : [key('hush', false, 'Silence all')]) : isMine ? [key('release', false, 'Unassign all')] : free ? [key('take', true, 'Take all'), ...(free === all.length ? [key('hand')] : [])] : [key('over', false, 'Take over all')];
  return {
    ...first, key: of, cars: names, name: counted(all.length, 'car'), title: isLostCars ? 'No data: cars may be moving' : first.title.replace(/, car may move$/, ', cars may move'),
    detail: rangeOf(names), since_s: Math.max(...all.map(({ since_s }) => since_s ?? 0)), who: { text: who, is: free ? 'nobody' : first.who.is },
    keys: [...keys, show], isUnassigned: free > 0, sound: loudest(all), isFilled: all.some(({ isFilled }) => isFilled),
  };
}

/** What the alarms that nobody has need, and the cars that fell silent. @param {Item[]} items @returns {import('../core/protocol-types.js').Sound} */
export function loudest(items) {
  return /** @type {const} */ (['high', 'medium', 'low']).find((sound) => items.some((item) => item.sound === sound)) ?? 'none';
}

/** "C34 to C64" where no number is left out, else the first few. @param {string[]} names in order */
export function rangeOf(names) {
  const parts = names.map((name) => /^(.*?)(\d+)$/.exec(name));
  const [first] = parts;
  const isRow = names.length > 2 && first && parts.every((part, i) => part && part[1] === first[1] && Number(part[2]) === Number(first[2]) + i);
  if (isRow) return `${names[0]} to ${names.at(-1)}`;
  return names.length > 6 ? `${names.slice(0, 5).join(', ')} and ${names.length - 5} more` : names.join(', ');
}

/** The head of the queue: how many, and how many of them nobody has. @param {Item[]} items of one car each @param {number} shown as so many groups */
export function headOf(items, shown) {
  const free = items.filter(({ isUnassigned }) => isUnassigned).length;
  const all = shown < items.length ? `${items.length} in ${counted(shown, 'group')}` : String(items.length);
  return free ? `${all} · ${free} unassigned` : all;
}

/** @param {FleetEvent} a @param {FleetEvent} b */
const byNewest = (a, b) => b.time_ms - a.time_ms || b.n - a.n;

/** The events with one more; one that was there already is one. @param {FleetEvent[]} events @param {FleetEvent} one @returns {FleetEvent[]} */
export function withEvent(events, one) {
  const others = events.filter(({ vehicle, n }) => vehicle !== one.vehicle || n !== one.n);
  return [one, ...others].sort(byNewest).slice(0, EVENTS);
}
