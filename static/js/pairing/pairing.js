// The screen before all others where devices are paired: this phone's name, the PIN from the server's terminal, one key.

import { styled } from './access-style.js';
import { html, icon, listen, setAttribute, setText, setWords, show } from '../core/dom.js';
import { linkToken, onLink } from '../boot/pairing-token.js';
import { digitsOf, PIN_DIGITS, pinShown, reasonWords, triedWords, waitWords } from './pairing-layout.js';

const TRY_MS = 8000;

/**
 * @param {HTMLElement} root
 * @param {object} what
 * @param {import('./admission.js').Refusal} what.why
 * @param {string} what.name what this phone calls itself
 * @param {(me: {name: string, role: string}) => void} what.onPaired
 */
export function openPairing(root, { why, name, onPaired }) {
  let token = linkToken();
  let isBusy = false;
  let waitUntil_ms = 0;
  const reason = html('p', { class: 'block gone', role: 'alert' }, icon('warn'), html('b', {}, reasonWords(why)));
  show(reason, reasonWords(why) !== '');
  const where = html('p', { class: 'say' });
  const own = /** @type {HTMLInputElement} */ (html('input', { id: 'pair-name', type: 'text', maxlength: 40, autocomplete: 'off', spellcheck: 'false', enterkeyhint: 'next', 'data-f': 'pair-name' }));
  own.value = name;
  const pin = /** @type {HTMLInputElement} */ (html('input', {
    id: 'pair-pin', class: 'n', type: 'text', inputmode: 'numeric', autocomplete: 'one-time-code', pattern: '[0-9 ]*', maxlength: 12, enterkeyhint: 'go', placeholder: '––– –––', 'aria-describedby': 'pair-says', 'data-f': 'pair-pin',
  }));
  const says = html('p', { class: 'says', id: 'pair-says', role: 'alert', 'data-f': 'pair-says' });
  const go = html('button', { type: 'submit', class: 'main', 'data-f': 'pair-go' });
  const pad = html('div', { class: 'pad', role: 'group', 'aria-label': 'Digits' },
    ...['1', '2', '3', '4', '5', '6', '7', '8', '9'].map((digit) => html('button', { type: 'button', class: 'key n', 'data-digit': digit }, digit)),
    html('span'), html('button', { type: 'button', class: 'key n', 'data-digit': '0' }, '0'),
    html('button', { type: 'button', class: 'key', 'data-f': 'pair-back', 'aria-label': 'Delete the last digit' }, icon('back')));
  const byPin = html('div', { class: 'by-pin' }, html('div', { class: 'lab-row' }, html('label', { for: 'pair-pin' }, 'PIN')), html('div', { class: 'field pin' }, pin), pad);
  const form = html('form', { class: 'form', novalidate: true, 'data-f': 'pair-form' },
    html('div', { class: 'view' },
      html('div', { class: 'hero' }, html('h1', { tabindex: -1 }, 'Pair this phone')), reason, where,
      html('div', { class: 'lab-row' }, html('label', { for: 'pair-name' }, 'Name of this phone')), html('div', { class: 'field' }, own),
      byPin, says),
    html('div', { class: 'bottom' }, go));
  root.replaceChildren(html('header', { class: 'top' }, html('span', { class: 'link' }, 'catgraph')), form);

  listen(pin, 'input', () => {
    setText(says, '');
    const digits = digitsOf(pin.value);
    if (pinShown(digits) !== pin.value) pin.value = pinShown(digits);
    draw();
  });
  listen(pad, 'click', (event) => {
    const key = /** @type {HTMLElement | null} */ (event.target.closest('button'));
    if (!key) return;
    const digits = digitsOf(pin.value);
    pin.value = pinShown(key.dataset['digit'] ? `${digits}${key.dataset['digit']}`.slice(0, PIN_DIGITS) : digits.slice(0, -1));
    setText(says, '');
    draw();
  });
  listen(form, 'submit', (event) => {
    event.preventDefault();
    pair();
  });
  onLink(() => {
    token = linkToken();
    setText(says, '');
    draw();
  });

  async function pair() {
    const digits = digitsOf(pin.value);
    if (isBusy || waiting_s() > 0) return;
    if (token === null && digits.length < PIN_DIGITS) {
      setText(says, `The PIN has ${PIN_DIGITS} digits.`);
      pin.focus();
      return;
    }
    isBusy = true;
    draw();
    const words = token === null ? { pin: digits } : { token };
    let status = 0;
    /** @type {any} */
    let body = {};
    try {
      const answer = await fetch('/api/pair', {
        method: 'POST', cache: 'no-store', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ ...words, name: own.value.trim() }), signal: AbortSignal.timeout(TRY_MS),
      });
      body = await answer.json().catch(() => ({}));
      status = answer.status;
    } catch {
      // no answer
    }
    isBusy = false;
    if (status === 200) {
      onPaired(body);
      return;
    }
    const { sentence, wait_s, isLinkOver } = triedWords(status, body);
    if (isLinkOver) token = null;
    waitUntil_ms = performance.now() + wait_s * 1000;
    pin.value = '';
    setWords(says, sentence);
    draw();
    says.scrollIntoView({ block: 'nearest' }); // on a small screen it lies beneath the digits
  }

  function waiting_s() {
    return token === null ? Math.max(0, Math.ceil((waitUntil_ms - performance.now()) / 1000)) : 0;
  }

  function draw() {
    const left_s = waiting_s();
    show(byPin, token === null);
    setWords(where, token === null
      ? 'The server shows a PIN of 6 digits on its terminal, with a QR code that does the same. Who is paired as operator can show one too: Settings, Paired devices.'
      : 'The code you scanned lets this phone in, once.');
    setAttribute(go, 'data-busy', isBusy || left_s > 0);
    setWords(go, isBusy ? 'Pairing' : left_s > 0 ? waitWords(left_s) : 'Pair this phone');
    if (left_s > 0) setTimeout(draw, 250);
  }

  styled().then(draw, draw);
  draw();
  /** @type {HTMLElement | null} */ (root.querySelector('h1'))?.focus({ preventScroll: true });
}
