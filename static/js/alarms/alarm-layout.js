// Which alarm shows where: one rule a place, none an alarm. Pure functions.

import { titleOf } from './alarm-title.js';
import { UNCONFIRMED, stripWords } from '../slowdown/slow-layout.js';
import { fixed, timeOfDay } from '../core/format.js';
import { RANK } from '../core/priority.js';

/**
 * @typedef {import('../core/protocol-types.js').StandingAlarm} Alarm
 * @typedef {import('../core/protocol-types.js').State} State
 * @typedef {import('../core/protocol-types.js').Sound} SoundName
 */

const LOUD = /** @type {SoundName[]} */ (['high', 'medium', 'low']);

/** @param {Alarm} alarm */
const isAsking = (alarm) => alarm.state === 'UNACKED' || alarm.state === 'RTN_UNACKED';

/**
 * Alarms about the chain itself. Their dialogs show the chain, with what can be done about it.
 * @param {Alarm} alarm
 */
export const isAboutLink = (alarm) => LINK_ACTIONS.some((action) => alarm.actions.includes(action));
const LINK_ACTIONS = /** @type {const} */ (['reconnect', 'exit', 'change_address']);

export { titleOf };

/** What waits for a person comes first, and of it what is active. */
const PLACE = /** @type {Record<Alarm['state'], number>} */ ({ UNACKED: 0, RTN_UNACKED: 1, ACKED: 2, NORMAL: 2, SHELVED: 3 });

/**
 * The one order of strip, list, dialog, snackbar and log: unacknowledged first, then by danger, then the newest. Of the
 * acknowledged ones those come first whose owner is off duty.
 * @param {Alarm[]} alarms
 */
export function byUrgency(alarms) {
  const place = (/** @type {Alarm} */ { state, off_duty_ms }) => (PLACE[state] ?? PLACE.ACKED) - (off_duty_ms ? 0.5 : 0);
  return [...alarms].sort((a, b) => place(a) - place(b) || RANK[b.priority] - RANK[a.priority] || b.raised_ms - a.raised_ms);
}

/**
 * What stands where.
 * @param {Alarm[]} alarms
 */
export function layOut(alarms) {
  const sorted = byUrgency(alarms);
  const asking = sorted.filter(isAsking);
  const standing = sorted.filter((alarm) => alarm.state !== 'SHELVED');
  const isPrompted = asking.some((alarm) => alarm.active && alarm.place !== 'list');
  return {
    // An ended alarm waits for its turn: its dialog would cover what is active and unacknowledged.
    dialog: asking.find((alarm) => alarm.place === 'dialog' && (alarm.active || !isPrompted)) ?? null,
    snackbars: asking.filter((alarm) => alarm.place === 'snackbar'),
    standing,
    shelved: sorted.length - standing.length,
    worst: standing[0] ?? null,
  };
}

/**
 * The sound that must play now, or null. What is acknowledged, silenced, shelved or over is silent. While paused the server
 * reports only what a pause does not hide: a lost link, a forgotten pause. A server that fell silent while it
 * watched a car is the loudest alarm of all, for nothing else can be announced; a paused one watches nothing.
 * @param {State | null} frame
 * @param {{isServerLost: boolean, isLossAcknowledged: boolean}} page
 * @returns {SoundName | 'count' | null} count: the car is slowed by itself in a moment, unless somebody vetoes it
 */
export function soundOf(frame, { isServerLost, isLossAcknowledged }) {
  if (!frame) return null;
  if (isServerLost) return isLossAcknowledged || frame.session.paused ? null : 'high';
  if (frame.decelerate.countdown) return 'count';
  const asking = frame.alarms.filter((alarm) => alarm.state === 'UNACKED' && !alarm.silenced_until_ms).map((alarm) => alarm.sound);
  return LOUD.find((sound) => asking.includes(sound)) ?? null;
}

/** @typedef {{kind: 'crit' | 'warn' | 'invert' | 'order' | '', icon: string, text: string, end: string, opens: 'alarms' | 'signals', hasReturned?: boolean, isKnown?: boolean, isUnconfirmed?: boolean}} Strip
 * hasReturned: nothing urgent stands any more, and nobody has acknowledged it; isKnown: it stands, and was acknowledged; isUnconfirmed: it says that the car does not slow */

/**
 * The one line under the tabs.
 * @param {State | null} frame
 * @param {{isSilent: boolean, chain: import('../core/link.js').ChainView, paused_s: number, stale?: number, unchecked?: 'all' | 'ok' | null}} seen stale: so many signals are on this page; unchecked: nothing is checked now, or what was OK is not any more
 * @returns {Strip}
 */
export function stripOf(frame, { isSilent, chain, paused_s, stale, unchecked }) {
  if (!frame) return { kind: 'invert', icon: 'unknown', text: 'Nothing received yet', end: 'not checked', opens: 'signals' };
  if (frame.session.paused && !isSilent) {
    return { kind: 'invert', icon: 'pause', text: `Paused ${paused(paused_s)}: no alarm is raised`, end: '', opens: 'alarms' };
  }
  if (chain.state === 'Lost') {
    return { kind: 'crit', icon: 'link-off', text: 'Connection lost', end: chain.since_ms === null ? '' : `since ${timeOfDay(chain.since_ms)}`, opens: 'alarms' };
  }
  if (isSilent) return { kind: 'invert', icon: 'clock', text: 'Values are not live', end: 'not checked', opens: 'signals' };
  const { standing, shelved } = layOut(frame.alarms);
  // An advisory that stands does not hide a warning that returned and waits to be acknowledged.
  const worst = standing.find(({ priority }) => priority !== 'advisory') ?? standing[0];
  const listed = frame.alarms.length + (frame.suppressed ?? []).length; // what the list behind it has
  const { ok, unknown, found } = countsOf(frame, { stale, unchecked });
  const open = `${unknown} not checked`;
  const order = stripWords(frame.decelerate, standing.length, found);
  // A critical alarm comes before the order, whose steps stand beneath; all else after it.
  if (order && worst?.priority !== 'critical') {
    return { ...order, icon: order.kind === 'crit' ? 'crit' : 'slow', opens: 'alarms' };
  }
  if (worst && worst.priority !== 'advisory') {
    const isOne = standing.length === 1 && worst.priority === 'critical' && worst.active;
    const among = isOne && listed === 1 ? `${fixed(worst.for_s)} s` : amongWords(listed);
    return {
      kind: worst.priority === 'critical' ? 'crit' : 'warn', icon: worst.priority === 'critical' ? 'crit' : 'warn',
      text: titleOf(worst), end: among, hasReturned: !worst.active, isKnown: worst.active && !isAsking(worst), opens: 'alarms',
      ...(worst.active && worst.id === UNCONFIRMED && { isUnconfirmed: true }),
    };
  }
  if (chain.cut === 2) {
    const isFirst = frame.link.topics_heard === 0;
    return { kind: 'invert', icon: isFirst ? 'unknown' : 'clock', text: isFirst ? 'Nothing received yet' : 'Values are not live', end: 'not checked', opens: 'signals' };
  }
  if (worst) {
    const end = listed > 1 ? amongWords(listed) : found || (unknown ? open : `${ok} OK`);
    return { kind: '', icon: 'info', text: worst.title, end, opens: 'alarms' };
  }
  return { kind: '', icon: found || unchecked ? 'info' : 'ok', text: 'No alarms', end: shelved ? `${shelved} shelved · ${found || open}` : `${found || `${ok} OK`} · ${open}`, opens: 'alarms' };
}

/** The checks as their tiles are counted. @param {State} frame @param {{stale?: number, unchecked?: 'all' | 'ok' | null}} seen */
function countsOf({ checks, signals }, { stale, unchecked }) {
  const tiles = tilesOf(checks);
  const of = (/** @type {string} */ verdict) => tiles.filter((tile) => tile.verdict === verdict).length;
  const isFuelAbsent = signals.fuel?.freshness === 'not_published' && !tiles.some((tile) => tile.label === 'Fuel'); // counted as its tile is
  const ok = unchecked ? 0 : of('ok');
  const faults = unchecked === 'all' ? 0 : of('fault'); // their alarms may be suppressed
  return { ok, unknown: tiles.length + Number(isFuelAbsent) - ok - faults, found: faults ? `${faults} FAULT` : stale ? `${stale} stale` : '' };
}

/** Of how many in the list this is one. @param {number} listed */
function amongWords(listed) {
  return listed > 1 ? `1 of ${listed}` : '1 alarm';
}

/**
 * @typedef {import('../core/protocol-types.js').Tile} Check
 * @typedef {{label: string, verdict: import('../core/protocol-types.js').Verdict, brief: string, text: string, ids: string[]}} Tile
 */

const WORSE = { fault: 2, unknown: 1, ok: 0 };

/**
 * One tile a label, in the order of their first; the worst of those that share it speaks.
 * @param {Check[]} checks
 * @returns {Tile[]}
 */
export function tilesOf(checks) {
  /** @type {Map<string, Tile>} */
  const tiles = new Map();
  for (const check of checks) {
    const { label } = check;
    const ids = check.checks ?? [check.id];
    const tile = tiles.get(label);
    if (!tile) {
      tiles.set(label, { label, verdict: check.verdict, brief: check.brief, text: check.text, ids: [...ids] });
      continue;
    }
    tile.ids.push(...ids);
    if (WORSE[check.verdict] > WORSE[tile.verdict]) Object.assign(tile, { verdict: check.verdict, brief: check.brief, text: check.text });
  }
  return [...tiles.values()];
}

/** @param {number} seconds */
function paused(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, '0')}`;
}
