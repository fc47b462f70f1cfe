// The texts of mail: pure functions. Addresses apart, states, sizes, the link for the phone's own mail program.

import { sizeWords } from './files-layout.js';
import { counted, timeOfDay } from '../core/format.js';

/**
 * @typedef {'mcap' | 'bag' | 'csv' | 'html'} MailFormat
 * @typedef {'queued' | 'sending' | 'sent' | 'failed' | 'cancelled'} MailState
 *
 * @typedef {object} MailPart one mail of an order
 * @property {number} part
 * @property {number} parts
 * @property {MailState} state
 * @property {string} said
 * @property {number} attempts
 * @property {number | null} next_ms
 * @property {{address: string, state: 'waiting' | 'accepted' | 'refused', said: string}[]} recipients
 *
 * @typedef {object} Mail one order as GET /api/mail tells of it
 * @property {number} n
 * @property {number} ordered_ms
 * @property {string[]} recordings
 * @property {MailFormat} format
 * @property {string[]} to
 * @property {string} subject
 * @property {MailState} state
 * @property {string} said
 * @property {boolean} is_ready
 * @property {number | null} share
 * @property {'attached' | 'split' | 'link' | null} way
 * @property {number | null} size_bytes
 * @property {MailPart[]} parts
 */

export const FORMATS = /** @type {const} */ ([
  ['mcap', 'MCAP', 'as recorded: Foxglove, Lichtblick'],
  ['bag', 'ROS 1 bag', 'rosbag, rqt'],
  ['csv', 'CSV', 'a table for each signal'],
  ['html', 'Report', 'one page with plots and alarms'],
]);
/** The ending and the kind of each, as a phone needs them. */
export const KINDS = /** @type {Record<MailFormat, [string, string]>} */ ({
  mcap: ['mcap', 'application/octet-stream'], bag: ['bag', 'application/octet-stream'], csv: ['zip', 'application/zip'], html: ['html', 'text/html'],
});
/** What mail programs and phones take of such an address, with some room. */
const MOST_MAILTO = 1900;

/**
 * The addresses in a field, as they were typed: between commas, semicolons and blanks.
 * @param {string} typed
 */
export function recipientsOf(typed) {
  return [...new Set(typed.split(/[\s,;]+/).filter(Boolean))];
}

/**
 * What is plainly wrong with the addresses, before anything is sent to the server; null: nothing.
 * @param {string[]} addresses
 */
export function recipientProblem(addresses) {
  if (addresses.length === 0) return 'Enter a recipient, such as ann@example.org.';
  if (addresses.length > 20) return 'A mail has at most 20 recipients.';
  const odd = addresses.find((one) => !/^[^@]+@[^@]+$/.test(one));
  return odd === undefined ? null : `“${odd.slice(0, 60)}” is not an address.`;
}

/**
 * What becomes of so much: attached, or too large for one mail.
 * @param {number | null} bytes of the recordings
 * @param {number} limit_mb
 * @param {'split' | 'link'} tooLarge
 */
export function sizeNote(bytes, limit_mb, tooLarge) {
  const limit = sizeWords(limit_mb * 1e6);
  const more = tooLarge === 'split' ? 'several mails, with a sentence on how to join them' : 'a link to this server';
  if (bytes === null) return `It is compressed. Above ${limit} it is sent as ${more}.`;
  const recorded = `${sizeWords(bytes)} as recorded`;
  if (bytes <= limit_mb * 1e6) return `${recorded}, compressed: one mail.`;
  return `${recorded}, compressed before it is sent. Above ${limit} it is sent as ${more}.`;
}

/**
 * The entry of one order in the outbox: its state as a label and an icon, and the details.
 * @param {Mail} mail
 * @param {number} now_ms
 * @returns {{label: string, icon: string, isBad: boolean, detail: string}}
 */
export function stateOf(mail, now_ms) {
  const share = mail.share === null ? '' : ` ${Math.round(mail.share * 100)} %`;
  const sent = mail.parts.filter(({ state }) => state === 'sent').length;
  const reply = mail.said;
  const parts = mail.parts.length > 1 ? `${sent} of ${mail.parts.length} parts sent. ` : '';
  switch (mail.state) {
    case 'queued': {
      if (!mail.is_ready) return { label: `Preparing${share}`, icon: 'clock', isBad: false, detail: '' };
      const next = Math.min(...mail.parts.map(({ state, next_ms }) => (state === 'queued' && next_ms !== null ? next_ms : Infinity)));
      const tries = next > now_ms && Number.isFinite(next) ? `${reply ? ' ' : ''}Tried again at ${timeOfDay(next)}.` : '';
      return { label: reply ? 'Waiting' : 'Queued', icon: 'clock', isBad: false, detail: `${parts}${sentence(reply)}${tries}` };
    }
    case 'sending': return { label: `Sending${share}`, icon: 'mail', isBad: false, detail: parts.trim() };
    case 'sent': return { label: 'Sent', icon: 'ok', isBad: false, detail: `${mail.parts.length > 1 ? `${counted(mail.parts.length, 'part')}. ` : ''}${sentence(reply)}` };
    case 'failed': return { label: 'Failed', icon: 'warn', isBad: true, detail: `${parts}${sentence(reply)}` };
    default: return { label: 'Cancelled', icon: 'close', isBad: false, detail: sentence(reply) };
  }
}

/** Which keys an order has. @param {Mail} mail */
export function keysOf(mail) {
  const isWaiting = mail.state === 'queued' && mail.is_ready && mail.said !== '';
  return {
    cancel: ['queued', 'sending', 'failed'].includes(mail.state) ? (mail.state === 'failed' ? 'Give up' : 'Cancel') : null,
    resend: isWaiting ? 'Try now' : ['failed', 'sent', 'cancelled'].includes(mail.state) ? 'Send again' : null,
  };
}

/** What it is, in one line. @param {Mail} mail */
export function aboutOf(mail) {
  const what = mail.recordings.length === 1 ? mail.recordings[0] ?? '' : counted(mail.recordings.length, 'recording');
  const format = FORMATS.find(([name]) => name === mail.format)?.[1] ?? mail.format;
  const way = mail.way === 'split' ? `${mail.parts.length} parts` : mail.way === 'link' ? 'as a link' : '';
  return [what, format, mail.size_bytes === null ? '' : sizeWords(mail.size_bytes), way].filter(Boolean).join(' · ');
}

/** Who did not get it, and why, where the reply of the order does not contain it. @param {Mail} mail */
export function refusedOf(mail) {
  if (mail.to.length < 2) return [];
  const found = new Map(mail.parts.flatMap(({ recipients }) => recipients.filter(({ state }) => state === 'refused').map(({ address, said: reply }) => [address, reply])));
  return [...found].map(([address, reply]) => `${address}: ${reply}`).filter((line) => !mail.said.includes(line));
}

/**
 * The address that opens the phone's mail program with all of it filled in; a file cannot ride in it, so links do.
 * @param {{to: string[], subject: string, text: string, links: string[]}} what
 */
export function mailtoOf({ to, subject, text, links }) {
  const places = `\n\n${links.join('\n')}\n`;
  const build = (/** @type {string} */ body) => `mailto:${to.map((one) => encodeURIComponent(one).replace('%40', '@')).join(',')}?subject=${encodeURIComponent(subject)}&body=${encodeURIComponent(body).replaceAll('%0A', '%0D%0A')}`;
  const whole = build(`${text}${places}`);
  if (whole.length <= MOST_MAILTO) return whole;
  let short = text;
  while (short && build(`${short}…${places}`).length > MOST_MAILTO) short = [...short].slice(0, -50).join('');
  return build(`${short}…${places}`);
}

/** Where a recording lies in a format, for a link. @param {string} id @param {MailFormat} format */
export function pathOf(id, format) {
  return `/api/recordings/${encodeURIComponent(id)}/${format === 'mcap' ? 'file.mcap' : `export/${format}`}`;
}

/** @param {string} reply */
function sentence(reply) {
  return reply === '' || /[.!?]$/.test(reply) ? reply : `${reply}.`;
}
