// The texts of the slow-down: of its slide, the strip, the steps, the count-down and the sheets in each state. Pure functions.

import { speedWords } from '../core/units.js';
import { age, fixed, timeOfDay } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').SlowDownState} Decelerate
 * @typedef {import('../core/protocol-types.js').SlowDownOrder} SlowOrder
 * @typedef {import('../core/protocol-types.js').GuardState} Guard
 *
 * @typedef {object} Seen what decides how the slow-down looks on this page
 * @property {Decelerate | null} now
 * @property {boolean} isSilent the server is
 * @property {boolean} isViewer
 * @property {boolean} isReplay
 * @property {boolean} mayControl this page is in control, or nobody is
 * @property {string | null} holder who is in control
 * @property {string} [vehicle] the name of the car; '' where it has none
 * @property {string} [car] the same in at most 8 characters
 */

/** The alarm whose title says that the car does not slow. */
export const UNCONFIRMED = 'slow_down_unconfirmed';
/** The unmistakable sentence, the same wherever it stands. */
export const NOT_CONFIRMED = 'NOT CONFIRMED – use the physical stop';
const AID = 'An aid, not an emergency stop: Wi-Fi and the bridge are in its path. The safety driver stops the car.';
/** A guard that sends nothing for so long cannot be relied on [s]; it reports at least twice a second. */
const GUARD_HEARD_S = 2;
/** A longer reason does not fit the slide; the sheet behind it gives it whole [characters]. */
const BRIEF = 44;

const STATES = /** @type {Record<string, string>} */ ({ not_available: 'NOT AVAILABLE', not_armed: 'NOT ARMED', armed: 'ARMED', ordered: 'SLOWING', holding: 'HOLDING' });

/** The facts that decide how this page shows the slow-down now. @param {import('../core/store.js').Store} store @param {string} [car] its short name @returns {Seen} */
export function seenOf(store, car = store.vehicle) {
  const { frame, control } = store;
  return {
    now: frame?.decelerate ?? null, isSilent: store.isSilent, isViewer: store.isViewer, isReplay: frame?.replay !== undefined,
    mayControl: store.fence !== null || !control?.holder, holder: control?.holder ?? null,
    vehicle: nameOf(store.vehicle), car: nameOf(car),
  };
}

/** A car's name in a sentence; '' where the operator gave it none, so that the server calls it "car". @param {string} name */
export const nameOf = (name) => (name === 'car' ? '' : name);

/** Its state as one term. @param {Seen} seen */
export function stateWord({ now, isSilent }) {
  if (isSilent || !now) return 'NOT KNOWN';
  const order = orderOf(now);
  if (order && !order.sending) return 'NOT SENDING';
  if (order?.stands) return 'STANDING';
  if (order && order.confirmed !== true) return order.confirmed === false ? 'NOT CONFIRMED' : 'ORDERED';
  return STATES[now.state] ?? 'NOT AVAILABLE';
}

/** An order stands. @param {Decelerate | null | undefined} now */
export function orderOf(now) {
  return now && (now.state === 'ordered' || now.state === 'holding') ? (now.order ?? null) : null;
}

/**
 * What a release would end: the order, or a hold of the guard's own; null: nothing holds the car.
 * @param {Decelerate | null | undefined} now
 */
export function holdOf(now) {
  const order = orderOf(now);
  if (order) return { number: order.number, isGuards: false };
  const guard = now?.guard;
  return guard && (guard.state === 'slowing' || guard.state === 'holding') ? { number: guard.hold, isGuards: true } : null;
}

/**
 * The slide.
 * @param {Seen} seen
 * @param {boolean} [isInAlarm] it is in the sheet of an alarm, from which nothing is armed
 * @returns {{kind: 'off' | 'armed' | 'go', title: string, why: string, label: string}} off: pressed, it shows why, or arms
 */
export function slideOf(seen, isInAlarm = false) {
  const { now, isSilent, isViewer } = seen;
  /** @param {string} title @param {string} why */
  const off = (title, why) => ({ kind: /** @type {const} */ ('off'), title, why, label: `${title}: ${why}` });
  if (isSilent || !now) return off('State unknown', 'no answer');
  const order = orderOf(now);
  if (order) {
    const [title, why] = goWords(now.state, order);
    return { kind: 'go', title, why, label: `${title} ${why}` };
  }
  if (now.state === 'armed') {
    if (isViewer) return off('Slow-down armed', 'not for viewers');
    return { kind: 'armed', title: 'Slide to slow', why: seen.car || 'the car', label: `Slide to slow ${seen.vehicle || 'the car'}. With a keyboard hold Enter for 1 second` };
  }
  if (now.state === 'not_armed') return isInAlarm && !isViewer ? off('Acknowledge first', 'then arm it') : off('Slow-down not armed', isViewer ? 'not for viewers' : 'press to arm');
  const why = bare(now.why ?? 'not available');
  const slide = off('Not available', why.length > BRIEF ? 'press for the reason' : why); // the bracket above says of what
  return { ...slide, label: `Slow-down n${slide.label.slice(1)}` };
}

/** @param {string} state @param {SlowOrder} order @returns {[string, string]} */
function goWords(state, order) {
  if (!order.sending) return ['Not sending', 'to the car now'];
  if (order.confirmed === false) return ['Use the', 'physical stop']; // line and legend give the reason
  const zero = speedWords(0).join(' ');
  if (order.stands) return ['Standing', `held at ${zero}`];
  if (state === 'holding' && order.confirmed) return ['Holding', `at ${zero}`];
  return [order.confirmed ? 'Slowing' : 'Ordered', `to ${zero}`];
}

/**
 * The strip while an order stands, where no critical alarm takes it; null: nothing to say.
 * @param {Decelerate | null | undefined} now
 * @param {number} standing alarms that stand too
 * @param {string} [found] faults or stale values, where no alarm stands
 * @returns {{kind: 'order' | 'crit', text: string, end: string, isUnconfirmed?: boolean} | null}
 */
export function stripWords(now, standing, found = '') {
  const order = orderOf(now);
  if (!now) return null;
  if (!order && holdOf(now)) return { kind: 'order', text: `The guard ${now.guard?.state === 'slowing' ? 'slows' : 'holds'} the car`, end: 'by itself' };
  if (!order) return null;
  if (order.confirmed === false) return { kind: 'crit', text: NOT_CONFIRMED, end: '', isUnconfirmed: true };
  const rate = `−${fixed(order.deceleration_mps2)} m/s²`;
  const also = standing ? ` · ${standing} ${standing === 1 ? 'alarm' : 'alarms'}` : found && ` · ${found}`;
  if (!order.sending) return { kind: 'order', text: 'Not sending to the car', end: also.slice(3) };
  if (order.stands) return { kind: 'order', text: 'The car stands', end: also.slice(3) || (order.stands === 'before' ? 'stood already' : 'not proven') };
  if (now.state === 'holding' && order.confirmed) return { kind: 'order', text: 'Holding the car', end: also ? `ordered${also}` : `${speedWords(0).join(' ')} ordered` };
  return order.confirmed
    ? { kind: 'order', text: 'Slowing the car', end: also ? `${rate}${also}` : `${rate} ordered` }
    : { kind: 'order', text: 'Slow-down ordered', end: `${rate}${also}` };
}

/**
 * From the press to the car, a step each: when the first was, and how much later the others.
 * @param {SlowOrder} order
 * @returns {{label: string, value: string, mark: 'ok' | 'wait' | 'crit'}[]}
 */
export function stepsOf({ steps, confirmed, sending, why, stands }) {
  const begun_ms = steps.pressed_ms ?? steps.server_ms;
  const after = (/** @type {number | null} */ at_ms) => (at_ms === null || begun_ms === null ? '–' : `+${fixed(Math.max(0, at_ms - begun_ms) / 1000, 2)} s`);
  const step = (/** @type {string} */ label, /** @type {number | null} */ at_ms, /** @type {string} */ isMissed) => ({
    label, value: at_ms === null && isMissed ? isMissed : after(at_ms),
    mark: /** @type {'ok' | 'wait' | 'crit'} */ (at_ms !== null ? 'ok' : isMissed ? 'crit' : 'wait'),
  });
  const isByHand = steps.pressed_ms !== null || why === 'by hand';
  // No more is claimed of a car that stands than that it stands.
  const slows = stands
    ? { label: 'Car stands', value: stands === 'before' ? 'already' : 'not proven', mark: /** @type {const} */ ('wait') }
    : step('Car slows', confirmed === false ? null : steps.slows_ms, confirmed === false ? 'NOT SEEN' : '');
  return [
    { label: isByHand ? 'Pressed' : 'By itself', value: timeOfDay(begun_ms), mark: begun_ms === null ? 'wait' : 'ok' },
    step('At the server', steps.server_ms, ''),
    step('On the bridge', steps.bridge_ms, sending ? '' : 'no link'),
    slows,
  ];
}

/**
 * The line beneath the steps: what is wrong with the order, or who gave it and why.
 * @param {SlowOrder} order
 * @param {number} lag_s
 * @returns {{text: string, kind: 'crit' | ''}}
 */
export function orderWords(order, lag_s) {
  if (order.confirmed === false) return { text: NOT_CONFIRMED, kind: 'crit' };
  if (!order.sending) return { text: 'Nothing is sent to the car: use the physical stop. Sending resumes when the link is back.', kind: 'crit' };
  if (order.stands) {
    const text = order.stands === 'before' ? 'The car was already standing: nothing to slow. Zero speed is commanded.'
      : 'The car stands. Its speed does not prove that the order stopped it. Zero speed is commanded.';
    return { text, kind: '' };
  }
  const who = order.why === 'by hand' ? `By ${order.by ?? 'hand'}` : `By itself: ${order.why}`;
  const from = order.from_mps === null ? '' : ` from ${speedWords(order.from_mps).join(' ')}`;
  return { text: `${who}${from}, ${age(order.for_s + lag_s)} s ago`, kind: '' };
}

/**
 * An automatic slow-down that is about to begin.
 * @param {Decelerate | null | undefined} now
 * @param {number} lag_s
 */
export function countdownOf(now, lag_s) {
  const coming = now?.countdown;
  if (!coming || orderOf(now)) return null;
  return { ...coming, left_s: Math.max(0, coming.left_s - lag_s) };
}

/**
 * Whether the car slows by itself when the link is lost.
 * @param {Guard | null | undefined} guard
 * @param {number} lag_s
 * @returns {{text: string, isGuarded: boolean}}
 */
export function guardWords(guard, lag_s = 0) {
  if (!guard) return { text: 'No guard on the car: link loss will NOT slow the car', isGuarded: false };
  const age_s = guard.age_s === null ? Infinity : guard.age_s + lag_s;
  if (age_s > GUARD_HEARD_S) return { text: `No message from the guard for ${age(age_s)} s: link loss may NOT slow the car`, isGuarded: false };
  const why = guard.why ? `: ${bare(guard.why)}` : '';
  if (guard.state === 'slowing') return { text: `GUARDED: the guard slows the car by itself${why}`, isGuarded: true };
  if (guard.state === 'holding') return { text: `GUARDED: the guard holds the car${why}`, isGuarded: true };
  if (guard.state === 'guarded' || guard.state === 'operator') return { text: 'GUARDED: the guard on the car slows it when the link is lost', isGuarded: true };
  return { text: `UNGUARDED: the guard receives no heartbeat${why}: link loss will NOT slow the car`, isGuarded: false };
}

/**
 * The key that lets the car go again.
 * @param {Seen} seen
 * @returns {{can: boolean, label: string, why: string}}
 */
export function releaseOf({ isViewer, mayControl, holder, car }) {
  if (isViewer) return { can: false, label: 'Release: not by a viewer', why: 'A viewer cannot release the car. The operator in control can.' };
  if (!mayControl) return { can: false, label: `Only ${holder ?? 'another'} can release`, why: `${holder ?? 'Another'} is in control: only the operator in control can release the car.` };
  return { can: true, label: `Release ${car || 'the car'}`, why: '' };
}

/** The key that leaves the order as it is. @param {string | undefined} state of the slow-down */
export function keepWords(state) {
  return state === 'holding' ? 'Keep holding' : 'Keep slowing';
}

/**
 * The sheet behind the slide: how it stands, what will be commanded, and what this page may do.
 * @param {Seen} seen
 * @param {number} lag_s
 * @returns {{title: string, text: string, facts: [string, string, boolean][], aid: string, guard: string, isGuarded: boolean, act: 'arm' | 'disarm' | 'ask' | null, message: string}} of a fact: name, value, whether it is a warning
 */
export function sheetOf(seen, lag_s) {
  const { now, isSilent, isViewer, isReplay, mayControl, holder } = seen;
  const order = orderOf(now);
  const guard = guardWords(now?.guard, lag_s);
  const plain = { aid: AID, guard: `${guard.text}.`, isGuarded: guard.isGuarded };
  /** @type {[string, string, boolean][]} */
  const facts = now?.topic ? [
    rivalsOf(now.rivals), // first: they may keep the car from slowing
    ['Commanded on', now.topic, false],
    ['Type', now.type ?? 'not known', !now.type],
    ['Slows at', `${fixed(now.deceleration_mps2 ?? null)} m/s²`, false],
  ] : [];
  if (isSilent || !now) return { ...plain, title: 'Slow-down unknown', text: 'The server does not answer.', facts: [], act: null, message: '' };
  if (isReplay) return { ...plain, title: 'As it was recorded', text: 'A recording is shown: nothing is sent to the car.', facts, act: null, message: '' };
  if (now.state === 'not_available') return { ...plain, title: 'Slow-down not available', text: now.why ?? 'The server sent no reason.', facts, act: null, message: '' };
  const isArmed = now.state === 'armed' || order !== null;
  const by = now.armed_by ? `Armed by ${now.armed_by}.` : '';
  const car = seen.vehicle || 'The car';
  const title = order ? `${car} is being slowed` : isArmed ? `Slow-down of ${car} armed` : seen.vehicle ? `Arm the slow-down of ${car}?` : 'Arm the slow-down?';
  const text = order ? orderWords(order, lag_s).text
    : isArmed ? `${by} Any operator can slow the car: slide to the end and let go.`.trim()
      : 'When armed, one slide slows the car. The steering angle is held, and speed 0 is commanded until the car is released.';
  if (order) return { ...plain, title, text, facts, act: null, message: '' };
  if (isViewer) return { ...plain, title, text, facts, act: null, message: 'This device is paired as a viewer: it can watch but not make changes.' };
  if (!mayControl) return { ...plain, title, text, facts, act: 'ask', message: `${holder ?? 'Another'} is in control and can ${isArmed ? 'disarm' : 'arm'} it.` };
  return { ...plain, title, text, facts, act: isArmed ? 'disarm' : 'arm', message: '' };
}

/** @param {string[] | null | undefined} rivals @returns {[string, string, boolean]} */
function rivalsOf(rivals) {
  if (!rivals) return ['Other publishers', 'unknown: the bridge does not list them', true];
  if (rivals.length === 0) return ['Other publishers', 'none', false];
  return ['Other publishers', `${rivals.join(', ')}: the last message wins, so the car may not slow`, true];
}

/**
 * Its row on the connect screen.
 * @param {Decelerate | null | undefined} now
 * @param {boolean} isMonitoring
 * @returns {{tag: string, kind: 'plain' | 'warn' | 'unk', cost: string}}
 */
export function connectRow(now, isMonitoring) {
  if (!isMonitoring || !now) return { tag: 'Not armed', kind: 'unk', cost: 'can be armed once connected' };
  const { text } = guardWords(now.guard);
  if (orderOf(now)) return { tag: 'Slowing', kind: 'warn', cost: 'the car is being slowed now' };
  if (now.state === 'armed') return { tag: 'Armed', kind: 'plain', cost: text };
  if (now.state === 'not_armed') return { tag: 'Not armed', kind: 'unk', cost: `can be armed. ${text}` };
  return { tag: 'Not available', kind: 'unk', cost: bare(now.why ?? 'not available') };
}

/** A sentence without its end. @param {string} sentence */
function bare(sentence) {
  return sentence.replace(/[.!]$/, '');
}
