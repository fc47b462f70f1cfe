// Who drives and what is known of an intervention, as texts: pure functions of the server's state.

import { distanceWords, duration, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').ModeState} ModeState
 * @typedef {import('../core/protocol-types.js').InterventionAnswer} Intervention
 * @typedef {{mode: ModeState['mode'], title: string, text: string, open: string | null}} Shown open: id of the intervention that is to be described first
 */

/** @type {Record<NonNullable<ModeState['why']>, string>} */
const WHY = { no_source: 'no mode topic', silent: 'mode topic is silent', flickers: 'the mode flickers', unclear: 'the car does not say' };
/** @type {Record<ModeState['mode'], string>} */
const TITLES = { autonomous: 'Autonomous', manual: 'Manual', unknown: 'Mode not known' };
/** The icons of the modes that are known, as paths. */
export const SHAPES = {
  autonomous: 'M7 7h10v10H7z M10.5 10.5h3v3h-3z M9.5 7V3.5 M14.5 7V3.5 M9.5 20.5V17 M14.5 20.5V17 M7 9.5H3.5 M7 14.5H3.5 M20.5 9.5H17 M20.5 14.5H17',
  manual: 'M12 3a9 9 0 1 0 0 18 9 9 0 1 0 0-18z M12 10a2 2 0 1 0 0 4 2 2 0 1 0 0-4z M3.5 10.5C8 9.5 9 10 10.2 11.2 M20.5 10.5C16 9.5 15 10 13.8 11.2 M12 14v6.5',
};
/** Of a newer server there may be others. @type {Partial<Record<string, {title: string, ask: string}>>} */
export const KINDS = {
  to_manual: { title: 'Take-over', ask: 'Describe take-over' },
  brake: { title: 'Braked', ask: 'Describe braking' },
  steer: { title: 'Steered', ask: 'Describe steering' },
};

/** What made somebody intervene: the name in the log, and the label of the key. @type {readonly (readonly [string, string])[]} */
export const CATEGORIES = [
  ['object_late', 'Object late'], ['path_wrong', 'Path wrong'], ['too_fast', 'Too fast'],
  ['other_traffic', 'Other traffic'], ['planned', 'Planned'], ['system_fault', 'System fault'],
];
/** @type {readonly (readonly [Intervention['initiated_by'], string])[]} */
export const STARTERS = [['driver', 'Driver'], ['operator', 'Operator'], ['system', 'Car']];

/** The icon of a hand-over's line, where the ledge has one for its mode. @param {{kind: string, key: string}} line "driving:manual:" */
export function shapeOf({ kind, key }) {
  return kind === 'driving' ? Object.entries(SHAPES).find(([mode]) => key.startsWith(`driving:${mode}:`))?.[1] ?? '' : '';
}

/**
 * @param {ModeState | null | undefined} mode null: nothing is known of the car
 * @param {number} now_ms the server's time of day
 * @param {boolean} isLinked data comes from the car
 * @returns {Shown}
 */
export function modeWords(mode, now_ms, isLinked) {
  if (!mode || !isLinked) return { mode: 'unknown', title: TITLES.unknown, text: 'no link to the car', open: mode?.open[0]?.id ?? null };
  const [first] = mode.open;
  const text = first ? (mode.open.length > 1 ? `${mode.open.length} to describe` : KINDS[first.kind_of]?.ask ?? 'Describe') : mode.why ? WHY[mode.why] : lasted(mode, now_ms);
  return { mode: mode.mode, title: TITLES[mode.mode], text, open: first?.id ?? null };
}

/** @param {ModeState} mode @param {number} now_ms */
function lasted({ since_ms, way_m }, now_ms) {
  const time = since_ms === null ? '' : duration((now_ms - since_ms) / 1000, true);
  const way = way_m === null ? '' : way_m < 100 ? `${Math.round(way_m)} m` : way_m >= 1000 && way_m < 100_000 ? `${fixed(way_m / 1000, 2)} km` : distanceWords(way_m).join(' ');
  return [time, way].filter(Boolean).join(' · ');
}

/** Who acted first, as the data show it. @param {Intervention} found @returns {{title: string, value: string, unit: string, text: string}} */
export function startedWords({ kind_of, initiated_by, brake_percent, acted_before_s }) {
  const by = { driver: 'By the driver', operator: 'By the operator', system: 'By the car', unknown: 'Started by' }[initiated_by] ?? 'Started by';
  const before = acted_before_s === null || acted_before_s < 0.05 ? '' : `${fixed(acted_before_s)} s before mode`;
  if (brake_percent !== null) return { title: by, value: String(Math.round(brake_percent)), unit: '% brake', text: before };
  if (kind_of === 'steer') return { title: by, value: 'wheel', unit: '', text: 'against the command' };
  return { title: by, value: initiated_by === 'unknown' ? 'not known' : '–', unit: '', text: before };
}

/** @param {Intervention} found @returns {{value: string, text: string}} */
export function alarmWords({ active, last_alarm_ago_s }) {
  if (active.length) return { value: String(active.length), text: active.join(', ') };
  return { value: '0', text: last_alarm_ago_s === null ? 'none before' : `last ${last_alarm_ago_s < 99.5 ? `${Math.round(last_alarm_ago_s)} s` : `${Math.round(last_alarm_ago_s / 60)} min`} ago` };
}
