// Settings as numbers and text: pure functions. What may be set, how a slider maps it, how it is displayed and typed.

import { shownIn, wireOf } from '../core/units.js';
import { isInDoubt, local, markOf } from '../core/decimal.js';
import { fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').SettingField} Field
 * @typedef {import('../core/protocol-types.js').SettingsAnswer} Settings
 *
 * @typedef {{values?: Record<string, number | null>, topics?: Record<string, string | null>, units?: Record<string, string | null>, profile?: string}} Change
 */

/** A slider's positions from one end to the other. */
export const POSITIONS = 1000;
/** A threshold that is only on or off. */
export const SWITCH = '0/1';

/**
 * Low, high and step of a threshold in the unit that is shown. The steps are round in that unit.
 * @param {Field} field
 */
export function scaleOf(field) {
  const { value: low, unit } = shownIn(field.minimum, field.unit);
  const high = shownIn(field.maximum, field.unit).value;
  const step = field.step ?? (field.maximum - field.minimum) / 200;
  return { low, high, unit, step: unit === field.unit ? step : roundUp(shownIn(step, field.unit).value) };
}

/**
 * Where a value stands on its slider, 0…1. A range that is far wider than what is usual is stretched at its low end.
 * @param {number} value in SI
 * @param {Field} field
 */
export function shareOf(value, field) {
  const share = Math.min(1, Math.max(0, (value - field.minimum) / (field.maximum - field.minimum)));
  return share ** (1 / bend(field));
}

/**
 * The value at a place of the slider, on the steps of the unit that is shown; the ends are reached. In SI.
 * @param {number} share 0…1
 * @param {Field} field
 */
export function valueAt(share, field) {
  if (share <= 0) return field.minimum;
  if (share >= 1) return field.maximum;
  const { low, high, step } = scaleOf(field);
  return toWire(Math.round((low + share ** bend(field) * (high - low)) / step) * step, field);
}

/**
 * Some steps up or down from a value, as an arrow key goes. In SI.
 * @param {number} value in SI
 * @param {number} steps
 * @param {Field} field
 */
export function stepped(value, steps, field) {
  const { step } = scaleOf(field);
  const now = shownIn(value, field.unit).value / step;
  // From between two steps the first goes to the next one.
  const from = Math.abs(now - Math.round(now)) < 1e-4 ? Math.round(now) : steps > 0 ? Math.floor(now) : Math.ceil(now);
  return toWire((from + steps) * step, field);
}

/**
 * How a value is read: with the decimals of its steps, and more only where it lies between them.
 * @param {number | null | undefined} value in SI
 * @param {Field} field
 * @param {string} [mark] the decimal mark
 */
export function textOf(value, field, mark) {
  if (value === null || value === undefined || !Number.isFinite(value)) return fixed(null);
  const { value: shown, unit } = shownIn(value, field.unit);
  const most = unit === field.unit ? 4 : 2; // a round number of m/s is none of mph
  let digits = decimals(scaleOf(field).step);
  while (digits < most && Math.abs(Number(shown.toFixed(digits)) - shown) > 2e-5) digits += 1;
  return local(fixed(shown, digits), mark);
}

/** An end of the range, as short as it can be. @param {number} value in SI @param {Field} field @param {string} [mark] the decimal mark */
export function endText(value, field, mark) {
  const { value: shown } = shownIn(value, field.unit);
  return local(fixed(Number(shown.toFixed(2)), decimals(Number(shown.toFixed(2)))), mark);
}

/**
 * A typed number, with a comma or a point: its value in SI, or a sentence of why it cannot be set.
 * @param {string} typed
 * @param {Field} field
 * @param {string} [mark] the decimal mark of the language
 * @returns {{value: number} | {refused: string}}
 */
export function readNumber(typed, field, mark = markOf()) {
  const { low, high, unit } = scaleOf(field);
  const text = typed.replace(/[\s\u00a0\u202f]/g, '').replace('−', '-');
  if (text === '') return { refused: `${field.title}: a number is required.` };
  const bare = text.toLowerCase().endsWith(unit.toLowerCase()) ? text.slice(0, -unit.length) : text;
  if (!/^[+-]?(\d+([.,]\d*)?|[.,]\d+)$/.test(bare)) return { refused: `${field.title}: “${typed.trim().slice(0, 20)}” is not a number.` };
  if (isInDoubt(bare, mark)) {
    const [many, few] = [bare.replace(/[.,]/, ''), bare.replace(',', '.')].map(Number);
    return { refused: `${field.title}: “${bare}” could be ${many} or ${local(String(few), mark)}. Type the one you mean.` };
  }
  const number = Number(bare.replace(',', '.'));
  // An end that is not round in the unit of this phone can be typed as it is read.
  const near = unit === field.unit ? 0 : 0.005;
  if (Math.abs(number - low) <= near) return { value: field.minimum };
  if (Math.abs(number - high) <= near) return { value: field.maximum };
  if (!(number >= low && number <= high)) {
    return { refused: `${field.title}: ${endText(field.minimum, field, mark)} to ${endText(field.maximum, field, mark)} ${unit} is allowed.` };
  }
  return { value: toWire(number, field) };
}

/**
 * The thresholds under their headings, in the order of the server.
 * @param {Record<string, Field>} schema
 * @returns {{heading: string, names: string[]}[]}
 */
export function groupsOf(schema) {
  /** @type {Map<string, string[]>} */
  const groups = new Map();
  for (const [name, { heading }] of Object.entries(schema)) groups.set(heading, [...(groups.get(heading) ?? []), name]);
  return [...groups].map(([heading, names]) => ({ heading, names }));
}

/**
 * Whether each term of the search occurs in one of these texts.
 * @param {string} query
 * @param {(string | null | undefined)[]} texts
 */
export function found(query, texts) {
  const all = plain(texts.filter(Boolean).join(' '));
  return plain(query).split(/\s+/).every((term) => all.includes(term));
}

/**
 * What must be set so that what is in force becomes what is wanted; null takes a thing back to its default.
 * @param {Settings} now
 * @param {Pick<Settings, 'values' | 'changed' | 'topics' | 'units'> & {profile: {chosen: string}}} wanted
 * @returns {Change}
 */
export function changeTo(now, wanted) {
  const own = (/** @type {{values: Record<string, number>, changed: string[]}} */ of, /** @type {string} */ name) =>
    (of.changed.includes(name) ? (of.values[name] ?? null) : null);
  const names = [...new Set([...now.changed, ...wanted.changed])].filter((name) => own(now, name) !== own(wanted, name));
  const [topics, units] = /** @type {const} */ (['topics', 'units']).map((part) => chosenAnew(now[part] ?? {}, wanted[part] ?? {}));
  return {
    ...(names.length ? { values: Object.fromEntries(names.map((name) => [name, own(wanted, name)])) } : {}),
    ...(topics ? { topics } : {}),
    ...(units ? { units } : {}),
    ...(now.profile.chosen === wanted.profile.chosen ? {} : { profile: wanted.profile.chosen }),
  };
}

/** What differs of the choices for each signal; null: nothing. @param {Record<string, string>} now @param {Record<string, string>} wanted @returns {Record<string, string | null> | null} */
function chosenAnew(now, wanted) {
  const signals = [...new Set([...Object.keys(now), ...Object.keys(wanted)])].filter((signal) => now[signal] !== wanted[signal]);
  return signals.length ? Object.fromEntries(signals.map((signal) => [signal, wanted[signal] ?? null])) : null;
}

/** Everything as the kind of car gives it. */
export const DEFAULTS = Object.freeze({ values: {}, changed: [], topics: {}, units: {}, profile: { chosen: 'auto' } });

/**
 * What a change does, a line each: "Speed limit: 9.0 → 11.0 m/s".
 * @param {Settings} now
 * @param {Change} change
 * @param {(signal: string) => string} label of a signal
 */
export function changeLines(now, { values = {}, topics = {}, units = {}, profile }, label) {
  const lines = Object.entries(now.schema).flatMap(([name, field]) => {
    const value = values[name];
    if (value === undefined) return [];
    const from = textOf(now.values[name], field);
    return [`${field.title}: ${from} → ${textOf(value ?? now.defaults[name], field)} ${scaleOf(field).unit}`];
  });
  for (const [signal, topic] of Object.entries(topics)) {
    lines.push(`Topic of ${label(signal)}: ${now.topics[signal] ?? 'chosen automatically'} → ${topic ?? 'chosen automatically'}`);
  }
  for (const [signal, unit] of Object.entries(units)) {
    lines.push(`Unit of ${label(signal)}: ${unitWords(now, signal, now.units?.[signal])} → ${unitWords(now, signal, unit)}`);
  }
  if (profile !== undefined) {
    const title = (/** @type {string} */ name) => (name === 'auto' ? 'as recognised' : (now.profiles.find((one) => one.name === name)?.title ?? name));
    lines.push(`Kind of car: ${title(now.profile.chosen)} → ${title(profile)}`);
  }
  return lines;
}

/** A unit that may be chosen for a signal, as an operator reads it. @param {Settings} settings @param {string} signal @param {string | null | undefined} name null: none is chosen */
export function unitWords(settings, signal, name) {
  if (name === null || name === undefined) return 'as found';
  return settings.unit_choices?.[signal]?.find((one) => one.name === name)?.label ?? name;
}

/** @param {number} shown @param {Field} field */
function toWire(shown, field) {
  const value = wireOf(Number(shown.toFixed(6)), field.unit);
  return Math.min(field.maximum, Math.max(field.minimum, Number(value.toFixed(6))));
}

/** How much the low end is stretched: 1 not at all. @param {Field} field */
function bend({ minimum, maximum, default: usual }) {
  return maximum - minimum > 25 && (usual - minimum) / (maximum - minimum) < 0.05 ? 3 : 1;
}

/** The next of 1, 2, 5, 10, … that is not smaller. @param {number} step */
function roundUp(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return Number(([1, 2, 5, 10].map((n) => n * power).find((round) => round >= step - 1e-9) ?? step).toPrecision(6));
}

/** @param {number} value */
function decimals(value) {
  return (String(Number(value.toFixed(6))).split('.')[1] ?? '').length;
}

/** @param {string} text */
function plain(text) {
  return text.normalize('NFKD').replace(/\p{M}/gu, '').toLowerCase().trim();
}
