// The texts of recordings in the list: their time, length, size and alarms. Pure functions, no DOM.

import { missingWords, namesWords } from './missing-topics.js';
import { duration, fixed, NOTHING } from '../core/format.js';
import { priorityOf, RANK } from '../core/priority.js';
import { speedWords } from '../core/units.js';

/**
 * @typedef {import('../core/protocol-types.js').Priority} Priority
 * @typedef {import('../core/protocol-types.js').Recording} Recording
 * @typedef {import('../core/protocol-types.js').Total} Total
 * @typedef {import('../core/protocol-types.js').ExportFormat} ExportFormat
 * @typedef {import('../core/protocol-types.js').RecordingList} Listing
 */

const MONTHS = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];
const DAY_MS = 86_400_000;
const two = (/** @type {number} */ number) => String(number).padStart(2, '0');

/**
 * By this phone's clock: "Today 14:03", "Yesterday 16:20", "19 Nov 14:05", and in another year "19 Nov 2025 14:05".
 * @param {number} at_ms
 * @param {number} now_ms
 */
export function whenWords(at_ms, now_ms) {
  const [at, now] = [new Date(at_ms), new Date(now_ms)];
  if (Number.isNaN(at.getTime())) return NOTHING;
  const time = `${two(at.getHours())}:${two(at.getMinutes())}`;
  if (at.toDateString() === now.toDateString()) return `Today ${time}`;
  const before = new Date(now.getFullYear(), now.getMonth(), now.getDate() - 1);
  if (at.toDateString() === before.toDateString()) return `Yesterday ${time}`;
  const year = at.getFullYear() === now.getFullYear() ? '' : ` ${at.getFullYear()}`;
  return `${at.getDate()} ${MONTHS[at.getMonth()]}${year} ${time}`;
}

/** What a recording is called. @param {Recording} row @param {number} now_ms */
export function nameOf(row, now_ms) {
  return row.title || whenWords(row.started_ms, now_ms);
}

/**
 * "57.1 MB", as disks are sold: 1 MB is a million bytes.
 * @param {number | null | undefined} bytes
 */
export function sizeWords(bytes) {
  if (bytes === null || bytes === undefined || !Number.isFinite(bytes)) return NOTHING;
  if (bytes < 999.5) return `${fixed(Math.max(0, bytes), 0)} B`;
  let value = bytes / 1000;
  for (const unit of ['kB', 'MB', 'GB']) {
    if (value < 999.5) return `${value < 9.95 || (value < 99.95 && unit !== 'kB') ? fixed(value) : fixed(value, 0)} ${unit}`;
    value /= 1000;
  }
  return `${fixed(value)} TB`;
}

/** "12:48 min", "1:02:05 h". @param {number | null} length_s */
export function lengthWords(length_s) {
  if (length_s === null) return NOTHING;
  return `${duration(length_s, true)} ${length_s < 3600 ? 'min' : 'h'}`;
}

/** "1.3 km", "76 m". @param {number} metres */
export function distanceWords(metres) {
  return metres < 999.5 ? `${fixed(metres, 0)} m` : `${fixed(metres / 1000)} km`;
}

/** What is beneath the name of a recording: whose it is, and what is to be known of it. @param {Recording} row @param {number} now_ms */
export function originWords(row, now_ms) {
  return [
    row.vehicle,
    row.is_clip ? 'clip' : '',
    (row.part ?? 1) > 1 ? `part ${row.part}` : '',
    row.format === 'bag' ? 'ROS 1 bag' : row.format === 'db3' ? 'ROS 2 db3' : row.format === 'folder' ? 'split ROS 2 bag' : '',
    row.ended === 'recovered' ? 'recovered' : '',
    row.damage.length ? 'damaged' : '',
    row.trashed_ms === null ? '' : `deleted ${whenWords(row.trashed_ms, now_ms)}`,
  ].filter(Boolean).join(' · ');
}

const COUNT_NAMES = /** @type {[Priority, string, string][]} */ ([['critical', 'critical alarm', 'critical alarms'], ['warning', 'warning', 'warnings'], ['advisory', 'advisory', 'advisories']]);

/** The counts that are not 0, most urgent first. @param {Recording['alarms']} alarms @returns {{priority: Priority, count: number, text: string}[]} */
export function countsOf(alarms) {
  return COUNT_NAMES.flatMap(([priority, one, many]) => {
    const count = Object.entries(alarms ?? {}).reduce((sum, [name, some]) => sum + (priorityOf(name) === priority ? some : 0), 0);
    return count > 0 ? [{ priority, count, text: `${count} ${count === 1 ? one : many}` }] : [];
  });
}

/**
 * The most urgent first, then as they were raised: what is left out of a short list is the least urgent.
 * @template {{priority: Priority, at_ms: number}} One
 * @param {One[]} raised
 */
export function byUrgency(raised) {
  return [...raised].sort((a, b) => RANK[b.priority] - RANK[a.priority] || a.at_ms - b.at_ms);
}

/** "2 critical alarms, 1 warning", "no alarms"; "alarms not recorded" is not the same. @param {Recording['alarms']} alarms */
export function alarmWords(alarms) {
  if (alarms === null) return 'alarms not recorded';
  return countsOf(alarms).map(({ text }) => text).join(', ') || 'no alarms';
}

/** All that is known of a recording in one sentence. @param {Recording} row */
export function factWords(row) {
  if (row.state === 'unreadable') return `${sizeWords(row.size_bytes)}. ${row.problem ?? 'It cannot be read.'}`;
  if (row.state === 'waiting') return `${sizeWords(row.size_bytes)}, being read.`;
  const [speed, unit] = speedWords(row.top_speed_mps);
  return `${[
    lengthWords(row.length_s), sizeWords(row.size_bytes), row.distance_m === null ? 'no position' : distanceWords(row.distance_m),
    row.top_speed_mps === null ? '' : `up to ${speed}\u00a0${unit}`, alarmWords(row.alarms),
  ].filter(Boolean).join(', ')}.`;
}

/** Where its copy in the store is; empty where the server has no store. @param {Recording['stored']} stored */
export function storedWords(stored) {
  if (!stored) return '';
  const { state, share, checked_ms, sentence } = stored;
  if (state === 'uploading') return `uploading ${Math.floor(100 * (share ?? 0))} %`;
  if (state === 'stored') return `stored (checked ${checked_ms === null ? NOTHING : clockOf(checked_ms)})${sentence ? `. Failed since: ${sentence}` : ''}`;
  if (state === 'failed') return `not stored, failed: ${sentence}`;
  return state === 'waiting' ? 'not stored, waits for its upload' : 'not stored';
}

/** A match that is farther from the beginning of the words is not seen on a narrow phone [letters]. */
const FAR = 20;

/** The words of a mark from shortly before the text that was searched for. @param {string} words @param {string} text */
function excerptOf(words, text) {
  const at = words.toLowerCase().indexOf(text.trim().toLowerCase());
  if (at <= FAR) return words;
  return `…${words.slice(Math.max(words.lastIndexOf(' ', at - FAR / 2) + 1, at - FAR))}`;
}

/**
 * The mark in which a search found its text: "Mark at 04:06: control · twice"; empty: it was found elsewhere.
 * @param {Recording} row
 * @param {string} [text] that was searched for
 */
export function matchWords({ matched, started_ms }, text = '') {
  if (!matched) return '';
  const at_s = matched.at_s ?? Math.max(0, (matched.marked_ms - started_ms) / 1000);
  return `Mark at ${duration(at_s, true)}: ${[matched.category, excerptOf(matched.words, text)].filter(Boolean).join(' · ')}`;
}

/** "14:03" by this phone's clock. @param {number} at_ms */
function clockOf(at_ms) {
  const at = new Date(at_ms);
  return `${two(at.getHours())}:${two(at.getMinutes())}`;
}

/** Why its file cannot be had as it is; empty: it can. @param {Recording} row */
export function whyNotAsItIs(row) {
  return row.several_files ? `It is ${row.several_files}: as it is, copy it from the server’s disk.` : '';
}

/** What else there is to say of it, in sentences. @param {Recording} row */
export function warningWords(row) {
  const why = row.ended_why ?? 'the server stopped during the recording.';
  const recovered = row.ended === 'recovered' ? [/recover/i.test(why) ? why : `Recovered: ${why}`] : [];
  const leftOut = row.left_out?.length ? [`Not recorded: ${namesWords(row.left_out, row.left_out_count)}.`] : [];
  const silent = row.not_received?.length ? [`No messages from: ${namesWords(row.not_received, row.not_received_count)}.`] : [];
  return [...recovered, ...row.damage, ...(row.unread ?? []), ...leftOut, ...silent];
}

/** @typedef {{kind: 'all' | 'vehicle' | 'tag' | 'days', value: string}} Choice */

/** @param {string} text as the page's select has it: "vehicle:car" @returns {Choice} */
export function choiceOf(text) {
  const [kind = '', ...rest] = text.split(':');
  return kind === 'vehicle' || kind === 'tag' || kind === 'days' ? { kind, value: rest.join(':') } : { kind: 'all', value: '' };
}

/**
 * The query of a list.
 * @param {{text: string, choice: Choice, cursor?: string | null, limit: number}} search
 * @param {number} now_ms
 */
export function queryOf({ text, choice, cursor, limit }, now_ms) {
  const query = new URLSearchParams({ limit: String(limit) });
  if (cursor) query.set('cursor', cursor);
  if (text.trim()) query.set('text', text.trim().slice(0, 200));
  if (choice.kind === 'vehicle' || choice.kind === 'tag') query.set(choice.kind, choice.value);
  if (choice.kind === 'days') {
    const today = new Date(now_ms);
    query.set('since_ms', String(new Date(today.getFullYear(), today.getMonth(), today.getDate()).getTime() - (Number(choice.value) - 1) * DAY_MS));
  }
  return query.toString();
}

/** Tags as they are typed: "wet, lot 3". @param {string} text */
export function tagsOf(text) {
  return text.split(/[,;\n]/).map((tag) => tag.trim()).filter(Boolean);
}

/** The points of a line of a sketch as SVG has them. @param {number[]} line */
export function pointsOf(line) {
  const pairs = [];
  for (let i = 0; i + 1 < line.length; i += 2) pairs.push(`${line[i]},${line[i + 1]}`);
  return pairs.join(' ');
}

/**
 * The recorder as the state tells of it.
 * @typedef {object} Recorder
 * @property {string} state off, recording, held, saving or stopped
 * @property {number | null} for_s
 * @property {number | null} [part]
 * @property {number} [bytes]
 * @property {number} [dropped] messages that were lost because the disk was too slow
 * @property {string | null} [reason] why it is not recording
 * @property {number} [as_json]
 * @property {string[]} [left_out]
 * @property {number} [left_out_count]
 * @property {string[]} [not_received]
 * @property {number} [not_received_count]
 * @property {{topic: string, mb: number}[]} [too_large]
 * @property {number} [too_large_count]
 *
 * @typedef {{name: string, mark: string, length: string, size: string, lost: string, missing: string, isOn: boolean, isBad: boolean, order: boolean | null}} Live order: what its key orders, true to record; null: no key
 */

const NAMES = /** @type {Record<string, string>} */ ({ recording: 'Recording now', held: 'Recording held', saving: 'Being saved', stopped: 'Recording stopped', off: 'Not recording' });

/**
 * The line above the list of recordings: what is recorded now, or why nothing is. Null: no line.
 * @param {Recorder | undefined} recorder
 * @param {{vehicle: string | null, isMonitoring: boolean, isSilent: boolean}} now
 * @returns {Live | null}
 */
export function liveOf(recorder, { vehicle, isMonitoring, isSilent }) {
  if (!recorder || (recorder.state === 'off' && !isMonitoring)) return null;
  const { state, for_s, part, bytes, dropped, reason } = recorder;
  const isOn = state === 'recording';
  const mark = isOn ? [vehicle ?? '', (part ?? 1) > 1 ? `part ${part}` : ''] : [reason ?? ''];
  if (isSilent) return { name: 'Recording?', mark: 'The server does not answer: the recording state is unknown.', length: '', size: '', lost: '', missing: '', isOn: false, isBad: true, order: null };
  return {
    length: for_s === null || state === 'off' ? '' : lengthWords(for_s), size: bytes ? sizeWords(bytes) : '', lost: dropped ? `${dropped} messages lost: the disk is too slow` : '',
    missing: isOn || state === 'held' ? missingWords(recorder) : '',
    name: NAMES[state] ?? state, mark: mark.filter(Boolean).join(' · '), isOn, isBad: state === 'stopped' || Boolean(dropped),
    order: state === 'saving' || !isMonitoring ? null : !(isOn || state === 'held'),
  };
}
