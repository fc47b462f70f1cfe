// The screen before all others where devices are paired: this phone's name, the PIN from the server's terminal, one key.

import { styled } from '../core/style-sheet.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { linkToken, onLink } from '../boot/pairing-token.js';
import { digitsOf, PIN_DIGITS, pinShown, reasonWords, triedWords, waitWords } from './pairing-layout.js';

const TRY_MS = 8000;

/**
 * @typedef {object} Pairing
 * @property {import('./admission.js').Refusal} why
 * @property {string} name of this phone
 * @property {(me: {name: string, role: string}) => void} onPaired
 */

/** @param {HTMLElement} root @param {Pairing} pairing */
export function openPairing(root, pairing) {
  const screen = new PairingScreen(root, pairing);
  styled('access').then(() => screen.draw(), () => screen.draw());
  screen.draw();
  /** @type {HTMLElement | null} */ (root.querySelector('h1'))?.focus({ preventScroll: true });
}

class PairingScreen {
  #token = linkToken();
  #isBusy = false;
  #waitUntil_ms = 0;

  /** @param {HTMLElement} root @param {Pairing} pairing */
  constructor(root, { why, name, onPaired }) {
    this.onPaired = onPaired;
    this.parts = build(root, reasonWords(why), name);
    const { form, pad, pin } = this.parts;
    listen(pin, 'input', () => this.#enter(digitsOf(pin.value)));
    listen(pad, 'click', (event) => {
      const key = /** @type {HTMLElement | null} */ (event.target.closest('button'));
      if (!key) return;
      const digits = digitsOf(pin.value);
      this.#enter(key.dataset['digit'] ? `${digits}${key.dataset['digit']}`.slice(0, PIN_DIGITS) : digits.slice(0, -1));
    });
    listen(form, 'submit', (event) => {
      event.preventDefault();
      void this.#pair();
    });
    onLink(() => {
      this.#token = linkToken();
      setText(this.parts.message, '');
      this.draw();
    });
  }

  /** @param {string} digits */
  #enter(digits) {
    const { pin, message } = this.parts;
    setText(message, '');
    if (pinShown(digits) !== pin.value) pin.value = pinShown(digits);
    this.draw();
  }

  async #pair() {
    const { own, pin, message } = this.parts;
    const digits = digitsOf(pin.value);
    if (this.#isBusy || this.#waiting_s > 0) return;
    if (this.#token === null && digits.length < PIN_DIGITS) {
      setText(message, `The PIN has ${PIN_DIGITS} digits.`);
      pin.focus();
      return;
    }
    this.#isBusy = true;
    this.draw();
    const { status, body } = await request({ ...(this.#token === null ? { pin: digits } : { token: this.#token }), name: own.value.trim() });
    this.#isBusy = false;
    if (status === 200) {
      this.onPaired(body);
      return;
    }
    const { sentence, wait_s, isLinkOver } = triedWords(status, body);
    if (isLinkOver) this.#token = null;
    this.#waitUntil_ms = performance.now() + wait_s * 1000;
    pin.value = '';
    setSentence(message, sentence);
    this.draw();
    message.scrollIntoView({ block: 'nearest' }); // on a small screen it is beneath the digits
  }

  /** How long the server accepts no PIN [s]. */
  get #waiting_s() {
    return this.#token === null ? Math.max(0, Math.ceil((this.#waitUntil_ms - performance.now()) / 1000)) : 0;
  }

  draw() {
    const { byPin, go, where } = this.parts;
    const left_s = this.#waiting_s;
    show(byPin, this.#token === null);
    setSentence(where, this.#token === null
      ? 'The server’s terminal shows a PIN of 6 digits and a QR code. A paired operator can show one too: Settings, Paired devices.'
      : 'The scanned code pairs this device, once.');
    setAttribute(go, 'data-busy', this.#isBusy || left_s > 0);
    setSentence(go, this.#isBusy ? 'Pairing' : left_s > 0 ? waitWords(left_s) : 'Pair this device');
    if (left_s > 0) setTimeout(() => this.draw(), 250);
  }
}

/** Sends a pairing request; status 0: no answer. @param {object} what @returns {Promise<{status: number, body: any}>} */
async function request(what) {
  try {
    const answer = await fetch('/api/pair', {
      method: 'POST', cache: 'no-store', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(what), signal: AbortSignal.timeout(TRY_MS),
    });
    return { status: answer.status, body: await answer.json().catch(() => ({})) };
  } catch {
    return { status: 0, body: {} };
  }
}

/** Builds the parts of the screen in `root`. @param {HTMLElement} root @param {string} why @param {string} name */
function build(root, why, name) {
  const reason = html('p', { class: 'block gone', role: 'alert' }, icon('warn'), html('b', {}, why));
  show(reason, why !== '');
  const where = html('p', { class: 'say' });
  const own = /** @type {HTMLInputElement} */ (html('input', { id: 'pair-name', type: 'text', maxlength: 40, autocomplete: 'off', spellcheck: 'false', enterkeyhint: 'next', 'data-f': 'pair-name' }));
  own.value = name;
  const pin = /** @type {HTMLInputElement} */ (html('input', {
    id: 'pair-pin', class: 'n', type: 'text', inputmode: 'numeric', autocomplete: 'one-time-code', pattern: '[0-9 ]*', maxlength: 12, enterkeyhint: 'go', placeholder: '––– –––', 'aria-describedby': 'pair-message', 'data-f': 'pair-pin',
  }));
  const message = html('p', { class: 'msg', id: 'pair-message', role: 'alert', 'data-f': 'pair-message' });
  const go = html('button', { type: 'submit', class: 'main', 'data-f': 'pair-go' });
  const pad = html('div', { class: 'pad', role: 'group', 'aria-label': 'Digits' },
    ...['1', '2', '3', '4', '5', '6', '7', '8', '9'].map((digit) => html('button', { type: 'button', class: 'key n', 'data-digit': digit }, digit)),
    html('span'), html('button', { type: 'button', class: 'key n', 'data-digit': '0' }, '0'),
    html('button', { type: 'button', class: 'key', 'data-f': 'pair-back', 'aria-label': 'Delete the last digit' }, icon('back')));
  const byPin = html('div', { class: 'by-pin' }, html('div', { class: 'lab-row' }, html('label', { for: 'pair-pin' }, 'PIN')), html('div', { class: 'field pin' }, pin), pad);
  const form = html('form', { class: 'form', novalidate: true, 'data-f': 'pair-form' },
    html('div', { class: 'view' },
      html('div', { class: 'hero' }, html('h1', { tabindex: -1 }, 'Pair this device')), reason, where,
      html('div', { class: 'lab-row' }, html('label', { for: 'pair-name' }, 'Name of this device')), html('div', { class: 'field' }, own),
      byPin, message),
    html('div', { class: 'bottom' }, go));
  root.replaceChildren(html('header', { class: 'top' }, html('span', { class: 'link' }, 'catgraph')), form);
  return { where, own, pin, message, go, pad, byPin, form };
}
