// The first screen: where the car is, and what this phone must allow before its alarms can be heard.

import { openPreferences } from './preferences.js';
import { FoundVehicles } from './found-vehicles.js';
import { addresses, armWords, bare, dialled, heldWords, isSameCar, keep } from './connect-layout.js';
import { closeSheet, openSheet } from './sheet.js';
import { field, html, icon, listen, need, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { connectRow } from '../slowdown/slow-layout.js';
import { age } from '../core/format.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {import('./router.js').Router} router
 * @param {import('../boot/arming.js').Arming} arming
 */
export function mount(root, store, router, arming) {
  const screen = new ConnectScreen(root, store, router, arming);
  const at = (/** @type {string} */ name) => field(root, name);
  const stops = [
    listen(at('form'), 'submit', (event) => {
      event.preventDefault();
      void screen.connect();
    }),
    listen(screen.input, 'input', () => screen.typed()),
    listen(at('history'), 'click', () => screen.openHistory()),
    listen(at('settings'), 'click', openPreferences),
    listen(at('found'), 'click', (event) => {
      const row = /** @type {HTMLElement | null} */ (event.target.closest('[data-address]'));
      if (row) screen.choose(row.dataset['address'] ?? '');
    }),
    store.on('draw', () => screen.draw()),
    store.on('open', () => screen.found.forget()),
  ];
  show(at('insecure'), !window.isSecureContext);
  screen.found.draw();
  screen.draw();
  return () => stops.forEach((stop) => stop());
}

class ConnectScreen {
  #isTyped = false;
  #offered = '';
  #isBusy = false;
  #wasSilent = false;
  #complaint = '';

  /**
   * @param {HTMLElement} root
   * @param {import('../core/store.js').Store} store
   * @param {import('./router.js').Router} router
   * @param {import('../boot/arming.js').Arming} arming
   */
  constructor(root, store, router, arming) {
    this.root = root;
    this.store = store;
    this.router = router;
    this.arming = arming;
    this.input = /** @type {HTMLInputElement} */ (field(root, 'address'));
    this.input.value = addresses()[0] ?? '';
    this.found = new FoundVehicles(field(root, 'found'), () => bare(this.input.value.trim()));
  }

  /** @param {string} address */
  choose(address) {
    this.input.value = bare(address);
    this.typed();
  }

  typed() {
    this.#isTyped = true;
    this.#complain('');
    this.#drawDialled();
    this.found.draw();
  }

  async connect() {
    const { arming, router, store } = this;
    arming.ask(); // within the tap, and before anything is awaited
    const address = this.input.value.trim();
    if (this.#isBack) {
      router.chosen();
      return;
    }
    this.#isBusy = true;
    this.#complain('');
    const answer = await store.ask('connect', { address });
    this.#isBusy = false;
    if (address) keep(address);
    router.suggestion = answer.suggestion ?? null;
    // The sheet of a failed connection shows why an address is bad; here stands why nothing was sent.
    if (!answer.ok && store.frame?.session.phase !== 'failed') this.#complain(answer.reason ?? 'Refused.');
    this.#isTyped = false;
    router.chosen();
  }

  /** Whether the vehicle in the field is being monitored: then there is nothing to connect. */
  get #isBack() {
    const address = this.store.frame?.session.address;
    return this.store.isMonitoring && typeof address === 'string' && isSameCar(address, this.input.value);
  }

  /** Whether the field names the car that the server was started for. */
  get #isConfigured() {
    const configured = this.store.frame?.session.configured;
    const here = bare(this.input.value.trim());
    return typeof configured === 'string' && (here === '' || isSameCar(here, configured));
  }

  /** @param {string} sentence */
  #complain(sentence) {
    this.#complaint = sentence;
    this.#drawComplaint();
    setAttribute(this.input, 'aria-invalid', sentence !== '' || null);
  }

  #drawComplaint() {
    const message = field(this.root, 'message');
    const sentence = this.#complaint || heldWords(this.store.frame?.session.held ?? null);
    setSentence(message, sentence);
    show(message, sentence !== '');
  }

  openHistory() {
    const sheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-history'));
    const before = addresses();
    show(field(sheet, 'none'), before.length === 0);
    field(sheet, 'list').replaceChildren(...before.map((address) => {
      const button = html('button', { type: 'button' }, icon('clock'), html('span', { class: 'n' }, address));
      button.addEventListener('click', () => {
        this.choose(address);
        closeSheet(sheet);
      });
      return html('li', {}, button);
    }));
    openSheet(sheet);
  }

  draw() {
    const { input, store } = this;
    if (this.root.hidden) return;
    void this.found.refresh(store.now());
    const session = store.frame?.session;
    // What is dialled, or the car the server was started for, comes before what was typed on this phone some day;
    // what names the same car stays as the operator wrote it.
    const address = session?.address ?? session?.configured ?? '';
    if (!this.#isTyped && document.activeElement !== input && address && address !== this.#offered && !isSameCar(address, input.value)) input.value = bare(address);
    this.#offered = address;
    this.#drawDialled();
    this.#drawKey();
    if (store.isSilent !== this.#wasSilent) this.#complain(store.isSilent ? 'The server does not answer; this page keeps trying.' : '');
    this.#wasSilent = store.isSilent;
    this.#drawComplaint();
    this.#drawArming();
  }

  #drawDialled() {
    const url = dialled(this.input.value);
    const at = field(this.root, 'dials');
    setSentence(at, url && `Dials ${url}`);
    show(at, url !== '');
  }

  #drawKey() {
    const { input, store: { frame } } = this;
    const session = frame?.session;
    const go = field(this.root, 'go');
    const isSame = session?.address ? isSameCar(session.address, input.value) : false;
    const isDialling = this.#isBusy || (session?.phase === 'connecting' && isSame);
    setAttribute(go, 'data-busy', isDialling);
    setSentence(go, isDialling ? `Connecting ${age(frame?.link.trying_for_s ?? 0)} s` : this.#isBack ? 'Back to monitoring' : this.#isConfigured ? `Connect to ${frame?.vehicle}` : 'Connect and arm alarms');
  }

  #drawArming() {
    const { root, store } = this;
    const { arms } = this.arming;
    const rows = /** @type {[string, {tag: string, kind: 'plain' | 'warn' | 'unk', cost: string}][]} */ ([
      .../** @type {const} */ (['sound', 'screen', 'position']).map((what) => [what, armWords(what, arms[what])]),
      ['slowdown', connectRow(store.frame?.decelerate, store.isMonitoring)],
    ]);
    for (const [what, arm] of rows) {
      drawTag(field(root, what), arm.tag, arm.kind);
      setText(field(root, `${what}-cost`), arm.cost);
    }
  }
}

/**
 * @param {HTMLElement} element
 * @param {string} text
 * @param {'plain' | 'warn' | 'unk'} kind
 */
function drawTag(element, text, kind) {
  const key = `${kind} ${text}`;
  if (element.dataset['key'] === key) return;
  element.dataset['key'] = key;
  element.className = kind === 'plain' ? 'tag' : `tag ${kind}`;
  element.replaceChildren(...(kind === 'plain' ? [icon('ok', 's')] : kind === 'warn' ? [icon('warn', 's')] : []), text);
}
