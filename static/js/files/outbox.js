// The outbox: every mail that was ordered, its state with the mail server's reply, and its keys.

import { keptAt } from '../core/kept-at.js';
import { request, sentenceOf } from '../control/request.js';
import { html, icon, listen, setText, setSentence, show, textNodes } from '../core/dom.js';
import { aboutOf, keysOf, refusedOf, stateOf } from './mail-layout.js';
import { styled } from '../core/style-sheet.js';
import { addSheet, openSheet } from '../shell/sheet.js';
import { timeOfDay } from '../core/format.js';

/**
 * @typedef {import('./mail-layout.js').Mail} Mail
 * @typedef {(sentence: string, title?: string) => void} Say
 */

const ASK_MS = 1000;
const PAGE = 20;

/** @type {Outbox | null} */
let outbox = null;

/** @param {Say} say */
export async function openOutbox(say) {
  await styled('mail');
  const at = keptAt('/api/mail');
  if (outbox?.at !== at) {
    outbox?.sheet.remove();
    outbox = new Outbox(say, at);
  }
  outbox.open();
}

class Outbox {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #next;
  #shown = PAGE;
  /** @type {Map<number, {key: string, element: HTMLElement}>} */
  #drawn = new Map();
  /** The mails with a request under way: their keys are disabled. @type {Set<number>} */
  #busy = new Set();

  /** @param {Say} say @param {string} at its address */
  constructor(say, at) {
    this.say = say;
    this.at = at;
    this.state = html('p', { class: 'sub', role: 'status', id: 'outbox-state' });
    this.list = html('ul', { class: 'outbox', 'aria-label': 'Mails' });
    this.none = html('p', { class: 'nothing', hidden: true }, 'No mail was sent from this server yet.');
    this.older = html('button', { type: 'button', class: 'key wide', hidden: true }, 'Older mails');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed mail-sheet', id: 'sheet-outbox', 'aria-labelledby': 'outbox-title', 'aria-describedby': 'outbox-state' },
      html('div', { class: 'bd' }, html('h2', { id: 'outbox-title', tabindex: -1 }, icon('mail'), 'Outbox'), this.state),
      html('div', { class: 'what', tabindex: 0, role: 'region', 'aria-label': 'Outbox' }, this.list, this.none),
      html('div', { class: 'keys' }, this.older, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
    addSheet(this.sheet);
    listen(this.sheet, 'close', () => clearTimeout(this.#next));
    listen(this.older, 'click', () => {
      this.#shown += PAGE;
      this.#ask();
    });
  }

  open() {
    this.#shown = PAGE;
    if (!this.list.firstChild) setText(this.state, 'Loading the outbox…');
    openSheet(this.sheet);
    this.#ask();
  }

  async #ask() {
    clearTimeout(this.#next);
    try {
      const { mails, next, trouble } = await request(`${this.at}?limit=${Math.min(this.#shown, 200)}`);
      setSentence(this.state, trouble ?? '');
      show(this.older, next !== null && this.#shown < 200);
      this.#draw(mails);
    } catch (error) {
      setSentence(this.state, `${sentenceOf(error)} The list below may be outdated.`);
    }
    clearTimeout(this.#next);
    if (this.sheet.open) this.#next = setTimeout(() => this.#ask(), ASK_MS);
  }

  /** @param {Mail[]} mails */
  #draw(mails) {
    const now_ms = Date.now();
    /** @type {Map<number, {key: string, element: HTMLElement}>} */
    const drawn = new Map();
    for (const mail of mails) {
      const key = JSON.stringify([mail, stateOf(mail, now_ms), this.#busy.has(mail.n)]);
      const old = this.#drawn.get(mail.n);
      drawn.set(mail.n, old?.key === key ? old : { key, element: this.#row(mail, now_ms) });
    }
    const elements = [...drawn.values()].map(({ element }) => element);
    if (elements.length !== this.list.children.length || elements.some((element, i) => this.list.children[i] !== element)) {
      const at = /** @type {HTMLElement | null} */ (document.activeElement?.closest('button[data-do]'));
      const [n, what] = [Number(at?.dataset['n']), at?.dataset['do']];
      this.list.replaceChildren(...elements);
      if (at) /** @type {HTMLElement | null | undefined} */ (drawn.get(n)?.element.querySelector(`[data-do="${what}"]`) ?? drawn.get(n)?.element.querySelector('button'))?.focus();
    }
    this.#drawn = drawn;
    show(this.none, mails.length === 0);
  }

  /** @param {Mail} mail @param {number} now_ms */
  #row(mail, now_ms) {
    const state = stateOf(mail, now_ms);
    const { cancel, resend } = keysOf(mail);
    const isBusy = this.#busy.has(mail.n);
    const key = (/** @type {string | null} */ label, /** @type {'cancel' | 'resend'} */ what) => {
      if (label === null) return [];
      const button = html('button', { type: 'button', class: 'key wide', 'data-do': what, 'data-n': mail.n, disabled: isBusy, 'aria-label': `${label}: ${mail.subject}` }, label);
      listen(button, 'click', () => this.#order(mail, what));
      return [button];
    };
    return html('li', { 'data-mail': mail.n, 'data-state': mail.state },
      html('div', { class: 't', dir: 'auto' }, mail.subject),
      html('p', { class: 'm', dir: 'auto' }, `to ${mail.to.join(', ')}`),
      html('p', { class: 'm' }, ...textNodes(`${dayTime(mail.ordered_ms, now_ms)} · ${aboutOf(mail)}`)),
      html('div', state.isBad ? { 'data-bad': true } : {}, html('p', { class: 'st' }, icon(state.icon), html('span', {}, ...textNodes(state.label))),
        html('p', { class: 'reply' }, ...textNodes(state.detail)), ...refusedOf(mail).map((line) => html('p', { class: 'reply' }, ...textNodes(line)))),
      html('div', { class: 'pair' }, ...key(resend, 'resend'), ...key(cancel, 'cancel')));
  }

  /** @param {Mail} mail @param {'cancel' | 'resend'} what */
  async #order(mail, what) {
    this.#busy.add(mail.n);
    try {
      await request(`${this.at}/${mail.n}/${what}`, { method: 'POST' });
    } catch (error) {
      this.say(sentenceOf(error), what === 'cancel' ? 'Not cancelled' : 'Not sent again');
    }
    this.#busy.delete(mail.n);
    await this.#ask();
  }
}

/** @param {number} at_ms @param {number} now_ms */
function dayTime(at_ms, now_ms) {
  const day = new Date(at_ms);
  const time = timeOfDay(at_ms).slice(0, 5);
  return day.toDateString() === new Date(now_ms).toDateString() ? time : `${day.toLocaleDateString()} ${time}`;
}
