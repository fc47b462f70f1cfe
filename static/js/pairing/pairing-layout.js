// The texts of the pairing screen, as pure functions.

import { counted } from '../core/format.js';

export const PIN_DIGITS = 6;

/** "123 456", as far as it is typed. @param {string} digits */
export function pinShown(digits) {
  return [digits.slice(0, 3), digits.slice(3)].filter(Boolean).join(' ');
}

/** Only the digits of what was typed or pasted. @param {string} text */
export function digitsOf(text) {
  return text.replace(/\D/g, '').slice(0, PIN_DIGITS);
}

/**
 * Why this device is not let in, before it tried.
 * @param {{code?: string, detail?: string}} why
 */
export function reasonWords({ code, detail }) {
  return code === 'removed' ? detail ?? 'This device is no longer paired.' : '';
}

/**
 * The result of a try as text, and whether to try again makes sense.
 * @param {number} status of the answer; 0: none came
 * @param {{code?: string, detail?: string, wait_s?: number}} body
 * @returns {{sentence: string, wait_s: number, isLinkOver: boolean}}
 */
export function triedWords(status, { code, detail, wait_s }) {
  const wait = Math.ceil(wait_s ?? 0);
  if (status === 0) return { sentence: 'The server does not answer. Try again.', wait_s: 0, isLinkOver: false };
  const sentence = {
    wrong: 'This PIN is wrong. Read it again from the server.',
    expired: 'No PIN is valid now: it was used, or is older than 10 minutes. Request a new one.',
    used: 'This link was used already, or is older than 10 minutes. Scan a new code, or type the PIN.',
    wait: 'Too many wrong PINs. Wait, or scan the QR code instead.',
    origin: 'The server does not accept the address of this page. Open it from the server’s QR code.',
  }[code ?? ''] ?? detail ?? `The server refused (${status}).`;
  return { sentence, wait_s: wait, isLinkOver: code === 'used' };
}

/** The label of the key during the waiting time. @param {number} left_s */
export function waitWords(left_s) {
  return `Wait ${counted(left_s, 'second')}`;
}
