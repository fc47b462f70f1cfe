// The cars of this server as the page shows them: short names, their order, what each needs. Pure functions, no DOM.

import { byUrgency } from '../alarms/alarm-layout.js';
import { titleOf } from '../alarms/alarm-title.js';
import { chipOf } from '../control/control-layout.js';
import { freshnessStyle } from '../core/freshness.js';
import { chainOf } from '../core/link.js';
import { age, duration } from '../core/format.js';
import { ICONS, RANK } from '../core/priority.js';

/**
 * @typedef {import('../core/protocol-types.js').Cars} Cars
 * @typedef {import('../core/protocol-types.js').ListedCar} ListedCar
 * @typedef {import('../core/protocol-types.js').CarAlarm} CarAlarm
 * @typedef {import('../core/protocol-types.js').Sound} SoundName
 * @typedef {import('../core/link.js').ChainView} ChainView
 *
 * @typedef {object} CarRow one car
 * @property {string} name
 * @property {number} rank the higher, the more it needs a person
 * @property {boolean} needs it needs one now
 * @property {'crit' | 'warn' | 'unknown' | 'info' | 'ok' | 'link-off'} icon
 * @property {'crit' | 'warn' | ''} kind
 * @property {boolean} isFilled the alarm stands, and nobody has acknowledged it
 * @property {string} text
 * @property {CarAlarm | null} worst
 * @property {ChainView | null} chain null: nothing is known of it
 * @property {{ink: import('../core/freshness.js').Freshness, value_mps: number | null}} speed
 * @property {string} age
 * @property {string} operator
 * @property {string} recording
 */

/** The most that fits beside the badge on the narrowest phone. */
const SHORT = 8;
/** A car whose summary is older is not known any more [s]; sent twice a second. */
const KNOWN_S = 3;
/** The list comes twice a second: so much of its age is that rhythm, and no silence [s]. */
const RHYTHM_S = 1;
const LOUD = /** @type {SoundName[]} */ (['high', 'medium', 'low']);

/**
 * A name of at most 8 characters for each car, and no two alike.
 * @param {string[]} names
 * @returns {Map<string, string>}
 */
export function shortNames(names) {
  const taken = new Set(names.filter((name) => plain(name).length <= SHORT).map((name) => plain(name).toLowerCase()));
  const given = new Map();
  const used = new Set();
  for (const name of names) {
    const whole = plain(name);
    let short = whole.length <= SHORT ? whole : shortened(whole);
    const isFree = () => !used.has(short.toLowerCase()) && (whole.length <= SHORT || !taken.has(short.toLowerCase()));
    for (let n = 2; !isFree(); n += 1) short = `${whole.slice(0, SHORT - String(n).length - 1).trim()}·${n}`;
    used.add(short.toLowerCase());
    given.set(name, short);
  }
  return given;
}

/** @param {string} name */
function plain(name) {
  return name.replace(/[-_]+/g, ' ').trim() || name;
}

/** Its number tells two of a fleet apart, so that the number stays. @param {string} whole */
function shortened(whole) {
  const number = /\s*(\d{1,4})$/.exec(whole);
  if (!number) return whole.slice(0, SHORT).trim();
  const tail = ` ${number[1]}`;
  return `${whole.slice(0, number.index).slice(0, SHORT - tail.length).trim()}${tail}`;
}

/**
 * Every car, the one that needs a person most first.
 * @param {Cars | null} cars
 * @param {number} lag_s age of the list at the glass
 * @param {string} page this page
 * @returns {CarRow[]}
 */
export function rowsOf(cars, lag_s, page) {
  return (cars?.cars ?? []).map((car, i) => ({ row: rowOf(car, cars?.time_ms ?? 0, lag_s, page), i }))
    .sort((a, b) => b.row.rank - a.row.rank || (b.row.worst?.raised_ms ?? 0) - (a.row.worst?.raised_ms ?? 0) || a.i - b.i)
    .map(({ row }) => row);
}

/** @param {ListedCar} car @param {number} time_ms @param {number} lag_s @param {string} page @returns {CarRow} */
function rowOf(car, time_ms, lag_s, page) {
  const { name, summary } = car;
  const since_s = car.age_s === null ? null : car.age_s + lag_s;
  if (car.off && !summary) {
    return {
      name, rank: 0, needs: false, icon: 'info', kind: '', isFilled: false, worst: null, chain: null, text: `Off on purpose: set by ${car.off.by}`,
      speed: { ink: 'never', value_mps: null }, age: since_s === null ? '–' : `${age(since_s)} s`, operator: '?', recording: '?',
    };
  }
  if (!summary || (since_s ?? Infinity) > KNOWN_S) {
    return {
      name, rank: 79, needs: true, icon: 'link-off', kind: 'crit', isFilled: true, worst: null, chain: null,
      text: since_s === null ? 'Not known: nothing received' : `Not known for ${age(since_s)} s`,
      speed: { ink: 'never', value_mps: null }, age: since_s === null ? '–' : `${age(since_s)} s`, operator: '?', recording: '?',
    };
  }
  const late_s = since_s ?? 0;
  const { link, phase, paused, worst } = summary;
  const chain = chainOf({
    frame: /** @type {any} */ ({ session: { phase, connected_for_s: link.connected_for_s }, link: { ...link, since_ms: null, problem: null } }),
    isSilent: false, silence_s: late_s, lag_s: late_s, heard_ms: 0,
  });
  const { ink } = freshnessStyle(/** @type {any} */ (summary.speed), late_s > RHYTHM_S ? late_s : 0);
  const speed = { ink: phase === 'monitoring' || ink === 'never' ? ink : /** @type {const} */ ('stale'), value_mps: summary.speed.value_mps };
  return {
    name, chain, speed, worst,
    ...stateOf(summary, worst, (time_ms - (worst?.raised_ms ?? 0)) / 1000 + lag_s),
    age: phase === 'idle' || chain.age_s === null ? '–' : `${age(chain.age_s)} s`,
    operator: chipOf({ holder: summary.holder, page: summary.page }, page, false).text,
    recording: summary.recording === 'recording' ? duration((summary.recording_for_s ?? 0) + late_s, true) : summary.recording,
  };
}

const KIND = /** @type {const} */ ({ critical: 'crit', warning: 'warn', advisory: '' });

/**
 * @param {import('../core/protocol-types.js').CarSummary} summary
 * @param {CarAlarm | null} worst
 * @param {number} for_s
 * @returns {Pick<CarRow, 'rank' | 'needs' | 'icon' | 'kind' | 'isFilled' | 'text'>}
 */
function stateOf({ phase, paused, planned_stop, waiting }, worst, for_s) {
  if (!worst) {
    if (phase === 'monitoring') return { rank: paused ? 15 : 10, needs: false, icon: paused ? 'unknown' : 'ok', kind: '', isFilled: false, text: paused ? 'Paused: no alarm is raised' : `No alarm${planned_stop ? ', planned stop' : ''}` };
    const text = phase === 'idle' ? 'Not connected' : phase === 'lost' ? 'Connection lost' : phase === 'failed' ? 'Connection failed' : 'Connecting';
    return { rank: phase === 'lost' || phase === 'failed' ? 20 : 5, needs: false, icon: 'unknown', kind: '', isFilled: false, text };
  }
  const { priority, state, title, active } = worst;
  const isAsking = state === 'UNACKED' || state === 'RTN_UNACKED';
  const text = !active ? titleOf(worst) : isAsking ? `${title}, ${age(for_s)} s` : `${title}, acknowledged`;
  const more = waiting > 1 ? ` +${waiting - 1}` : '';
  return {
    rank: isAsking ? (active ? 60 : 35) + 10 * (RANK[priority] - 1) : 25 + RANK[priority],
    needs: isAsking && priority !== 'advisory', icon: ICONS[priority], kind: KIND[priority], isFilled: isAsking && active, text: `${text}${more}`,
  };
}

/**
 * The badge of the chip: the other cars that need a person, in the shape of the worst.
 * @param {CarRow[]} rows
 * @param {string} shown the car of this page
 */
export function badgeOf(rows, shown) {
  const [first, ...rest] = rows.filter((row) => row.needs && row.name !== shown);
  return first ? { count: rest.length + 1, icon: first.icon, kind: first.kind, isFilled: first.isFilled } : null;
}

/** An alarm of another car, by car and occurrence. @param {CarRow} row */
export const keyOf = ({ name, worst }) => `${name} ${worst?.id} ${worst?.occurrence}`;

/**
 * The alarms of the other cars that nobody has acknowledged, and that were not left on this phone; the worst first.
 * @param {CarRow[]} rows
 * @param {string} shown
 * @param {Set<string>} left
 */
export function askingOf(rows, shown, left) {
  return rows.filter((row) => row.name !== shown && row.worst?.state === 'UNACKED' && row.worst.priority !== 'advisory' && !left.has(keyOf(row)));
}

/**
 * The other cars whose next alarm this phone would announce. A car announces its worst alarm only: while that one is critical,
 * unacknowledged and without sound here, a lesser one would not be announced.
 * @param {CarRow[]} rows
 * @param {string} shown
 * @param {Set<string>} left
 */
export function announcedOf(rows, shown, left) {
  const isMute = (/** @type {CarRow} */ row) => row.worst?.state === 'UNACKED' && row.worst.priority === 'critical' && (left.has(keyOf(row)) || row.worst.sound === 'none');
  return rows.filter((row) => row.name !== shown && row.chain !== null && !isMute(row)).map(({ name }) => name).sort();
}

/**
 * The louder of what this car's alarms need and what those of the others do.
 * @param {SoundName | 'count' | null} own
 * @param {CarRow[]} asking of the other cars
 * @returns {SoundName | 'count' | null}
 */
export function louder(own, asking) {
  if (own === 'count') return own;
  return LOUD.find((sound) => own === sound || asking.some(({ worst }) => worst?.sound === sound)) ?? null;
}

/**
 * The list of a server with one car, made of its state.
 * @param {import('../core/protocol-types.js').State | null} frame of the live car
 * @returns {Cars | null}
 */
export function alone(frame) {
  if (!frame) return null;
  const { session, link, signals, control, recording, decelerate, server } = frame;
  const standing = byUrgency(frame.alarms.filter(({ state }) => state !== 'SHELVED'));
  const isOpen = (/** @type {{state: string}} */ { state }) => state === 'UNACKED' || state === 'RTN_UNACKED';
  const speed = signals.speed;
  return {
    kind: 'cars', time_ms: server.time_ms,
    cars: [{
      name: frame.vehicle, age_s: 0,
      summary: {
        phase: session.phase, paused: session.paused,
        link: { cut: link.cut, bridge_age_s: link.bridge_age_s, car_age_s: link.car_age_s, trying_for_s: link.trying_for_s, connected_for_s: session.connected_for_s },
        worst: standing.find(isOpen) ?? standing[0] ?? null, waiting: standing.filter(isOpen).length,
        speed: { value_mps: speed?.value?.speed_mps ?? null, freshness: speed?.freshness ?? 'never', age_s: speed?.age_s ?? null, horizon_s: speed?.horizon_s ?? null },
        holder: control.holder, page: control.page ?? null, recording: recording.state, recording_for_s: recording.for_s, slow_down: decelerate.state,
      },
    }],
  };
}
