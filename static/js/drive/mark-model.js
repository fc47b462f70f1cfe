// A mark as this phone keeps it: what is still to be delivered of it, and how it is worded. Pure functions, no DOM.

import { counted, fixed, signed, timeOfDay } from '../core/format.js';

/** As the server has them. */
export const CATEGORIES = /** @type {const} */ (['object', 'control', 'planning', 'sensor', 'comfort', 'other']);
export const MOST_WORDS = 500;
/** A mark can be moved so far from its tap [s]. */
export const MOST_SHIFT_S = 12;
/** Marks that are delivered and older than this are left to the server [ms]. */
const KEPT_MS = 12 * 3_600_000;
const MOST_KEPT = 60;
/** A difference of clocks of at least this is shown [ms]. */
const SHOWN_MS = 200;

/**
 * @typedef {{blob: Blob | null, type: string, bytes: number, length_s: number | null, note: string, isOpen: boolean, isStored: boolean, made?: string}} Part a
 *   voice or a photo; made: tells it from what replaced it · blob: null once the server has it · note: what was cut or made smaller · isOpen: it is being spoken
 * @typedef {object} Mark
 * @property {string} id
 * @property {string} vehicle
 * @property {number} tap_ms when it was pressed, by the server's clock
 * @property {number} wall_ms the same by this phone's clock
 * @property {number} ahead_ms this phone's clock − the server's
 * @property {import('./mark-clock.js').Source} clock what tap_ms was corrected by
 * @property {number} shift_s moved by hand from there
 * @property {string | null} category
 * @property {string} words
 * @property {number} version counts what was changed here
 * @property {number} [turn] counts the changes of every kind, of all pages of this browser
 * @property {number} stored the version that the server has; 0: none
 * @property {boolean} isSent it may be at the server although no answer came
 * @property {boolean} isRemoved
 * @property {string} refused why the server did not take it, or not take it back
 * @property {Part | null} voice
 * @property {Part | null} photo
 * @typedef {'mark' | 'change' | 'remove' | 'drop' | 'voice' | 'photo'} Step
 */

/** @param {string} id @param {string} vehicle @param {import('./mark-clock.js').Moment} moment @param {number} wall_ms @returns {Mark} */
export function newMark(id, vehicle, { at_ms, ahead_ms, source }, wall_ms) {
  return { id, vehicle, tap_ms: at_ms, wall_ms, ahead_ms, clock: source, shift_s: 0, category: null, words: '', version: 1, stored: 0, isSent: false, isRemoved: false, refused: '', voice: null, photo: null };
}

/** Two copies of one mark: the newer one, the first where they are as new, with what only the other has. @param {Mark} one @param {Mark} other @returns {Mark} */
export function joined(one, other) {
  const [newer, older] = (other.turn ?? 0) > (one.turn ?? 0) ? [other, one] : [one, other];
  const part = (/** @type {'voice' | 'photo'} */ name) => {
    const [now, before] = [newer[name], older[name]];
    if (!now || !before || now.blob !== null || now.isStored || now.made !== before.made) return now;
    return { ...now, blob: before.blob, isStored: before.isStored, note: before.blob ? before.note : now.note || before.note };
  };
  return { ...newer, stored: Math.max(newer.stored, older.stored), voice: part('voice'), photo: part('photo') };
}

/** A voice that was being spoken when its page ended is whole as far as it came. @param {Mark} mark @returns {Mark} */
export function orphaned(mark) {
  if (!mark.voice?.isOpen) return mark;
  return { ...mark, voice: { ...mark.voice, isOpen: false, note: mark.voice.blob ? 'voice cut: the page was closed' : '' } };
}

/** What was too large for the storage when its page ended is named as lost. @param {Mark} mark @returns {Mark} */
export function bereft(mark) {
  const withNote = (/** @type {'voice' | 'photo'} */ name) => {
    const part = mark[name];
    return part && part.blob === null && !part.isStored && !part.isOpen ? { ...part, note: `${name} lost: the storage was full` } : part;
  };
  return { ...mark, voice: withNote('voice'), photo: withNote('photo') };
}

/** When it was, by the server's clock. @param {Mark} mark */
export function markedAt({ tap_ms, shift_s }) {
  return Math.round(tap_ms + shift_s * 1000);
}

/** The next command of the mark itself to the server; null: none. @param {Mark} mark @returns {'mark' | 'change' | 'remove' | 'drop' | null} */
export function commandOf({ isRemoved, isSent, stored, version }) {
  if (isRemoved) return stored > 0 || isSent ? 'remove' : 'drop';
  if (stored === 0) return 'mark';
  return stored < version ? 'change' : null;
}

/** What of it can be uploaded, once the server has the mark. @param {Mark} mark @returns {('voice' | 'photo')[]} */
export function partsOf(mark) {
  if (commandOf(mark)) return [];
  return /** @type {const} */ (['voice', 'photo']).filter((name) => isDue(mark[name]));
}

/** What is to be done next so that the server has it whole; null: nothing. @param {Mark} mark @returns {Step | null} */
export function stepOf(mark) {
  return commandOf(mark) ?? partsOf(mark)[0] ?? null;
}

/** @param {Part | null} part */
function isDue(part) {
  return part !== null && !part.isStored && !part.isOpen && part.blob !== null;
}

/** Those that wait for a car's server, oldest first. @param {Iterable<Mark>} marks @param {string} vehicle */
export function waitingOf(marks, vehicle) {
  return [...marks].filter((mark) => mark.vehicle === vehicle && stepOf(mark) !== null).sort((a, b) => a.wall_ms - b.wall_ms);
}

/** Those that need not be kept here any more. @param {Iterable<Mark>} marks @param {number} wall_ms */
export function outdated(marks, wall_ms) {
  const done = [...marks].filter((mark) => stepOf(mark) === null && !mark.voice?.isOpen).sort((a, b) => b.wall_ms - a.wall_ms);
  return done.filter(({ wall_ms: at_ms }, place) => place >= MOST_KEPT || Math.abs(wall_ms - at_ms) > KEPT_MS);
}

/** A time that nothing could correct when it was pressed, corrected now. @param {Mark} mark @param {number} ahead_ms this phone's clock − the server's */
export function corrected(mark, ahead_ms) {
  return { ...mark, tap_ms: Math.round(mark.wall_ms - ahead_ms), ahead_ms: Math.round(ahead_ms), clock: /** @type {const} */ ('remembered') };
}

/** "object" as it is read. @param {string | null} category */
export function categoryWords(category) {
  return category ? category.charAt(0).toUpperCase() + category.slice(1) : '';
}

/** The head of a row: "14:08:31 · photo". @param {Mark} mark */
export function headWords(mark) {
  const { category, voice, photo } = mark;
  const what = category ? category : voice?.note ? /^voice \w+/.exec(voice.note)?.[0] : voice ? 'voice' : photo ? 'photo' : mark.words ? 'words' : 'tap only';
  return `${timeOfDay(markedAt(mark))} · ${what}`;
}

/** The details of a row: the text, what came with it, what was cut or corrected. @param {Mark} mark @returns {string[]} */
export function moreWords(mark) {
  const { category, words, voice, photo, ahead_ms, clock, shift_s } = mark;
  const parts = [];
  if (words) parts.push(words);
  // No noun stands twice: the head may be it.
  if (voice) parts.push(voice.note || `${category || words ? 'voice ' : ''}${fixed(voice.length_s)} s`);
  if (photo) parts.push(photo.note || `${category || voice || words ? 'photo ' : ''}${fixed(photo.bytes / 1e6)} MB`);
  if (shift_s) parts.push(`moved by ${signed(shift_s)} s`);
  if (clock === 'unknown') parts.push('by the clock of this device, which was not compared with the server’s');
  else if (Math.abs(ahead_ms) >= SHOWN_MS) parts.push(`clock of this device ${signed(ahead_ms / 1000, 2)} s, corrected`);
  const refused = refusedWords(mark);
  if (refused) parts.push(refused);
  return parts;
}

/** What the server did not do, and why. @param {Mark} mark */
export function refusedWords(mark) {
  if (!mark.refused) return '';
  return `${stepOf(mark) === null ? 'not taken back' : 'not stored'}: ${mark.refused}`;
}

/** Where a mark is by now. @param {Mark} mark @param {boolean} isKept on the disk of this device @param {boolean} isDurable this device stores marks */
export function storageText(mark, isKept, isDurable) {
  if (mark.refused) return refusedWords(mark);
  if (stepOf(mark) === null) return 'stored';
  if (!isDurable) return 'until the page closes';
  return mark.stored || !isKept ? 'being stored' : 'stored on this device';
}

/** What stands on the Mark key when the server is away: "3 wait". @param {number} count */
export function waitWords(count) {
  return count === 0 ? '' : count === 1 ? '1 waits' : `${count} wait`;
}

/** @param {number} waiting @param {number} stored */
export function countWords(waiting, stored) {
  const parts = [...(waiting ? [waitWords(waiting)] : []), ...(stored || !waiting ? [`${stored} stored`] : [])];
  return parts.join(', ');
}

/** The head of the list where some wait. @param {Mark[]} waiting @param {boolean} isDurable @param {boolean} isAway */
export function waitingWords(waiting, isDurable, isAway) {
  const refused = waiting.filter((mark) => mark.refused !== '').length;
  const bytes = waiting.reduce((sum, { voice, photo }) => sum + (voice?.blob?.size ?? 0) + (photo?.blob?.size ?? 0), 0);
  return {
    title: `${counted(waiting.length, 'mark')} ${waiting.length === 1 ? 'waits' : 'wait'} on this device`,
    text: [
      isDurable ? 'They survive closing the page.' : 'This browser stores nothing: they are lost if the page is closed now.',
      ...(bytes ? [`${bytes < 1e5 ? 'Less than 0.1' : fixed(bytes / 1e6)} MB of voice and photos.`] : []),
      isAway ? 'Delivered automatically when the server answers, oldest first.' : refused < waiting.length ? 'They are being delivered, oldest first.' : '',
      refused && !isAway ? `The server refused ${refused}: offered again every 30 s.` : '',
    ].filter(Boolean).join(' '),
  };
}
