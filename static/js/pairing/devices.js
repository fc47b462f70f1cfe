// Who is paired with the server: each device with its role, a key that removes it, and a way to pair another.

import { styled } from '../core/style-sheet.js';
import { leftWords, removalWords, seenWords } from './devices-layout.js';
import { request, sentenceOf } from '../control/request.js';
import { html, icon, listen, setText, setSentence, show } from '../core/dom.js';
import { pinShown } from './pairing-layout.js';
import { addSheet, closeSheet, openSheet } from '../shell/sheet.js';
import { counted } from '../core/format.js';

const ASK_MS = 3000;
const ROLES = /** @type {const} */ ([['viewer', 'Viewer'], ['operator', 'Operator']]);

/**
 * @typedef {import('./devices-layout.js').Device} Device
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/**
 * @param {HTMLElement} place
 * @param {HTMLDetailsElement} group in which it is: while folded it requests nothing
 * @param {import('../core/store.js').Store} store
 * @param {Say} say
 * @param {(text: string) => void} head shows the state in the group's summary
 */
export async function mount(place, group, store, say, head) {
  await styled('access');
  if (store.isViewer) {
    place.replaceChildren(html('p', { class: 'state' }, `This device is paired as a viewer, under the name ${store.who?.name ?? ''}. An operator sees who is paired, and can make it an operator.`));
    return;
  }
  new Devices(place, group, say, head).start();
}

class Devices {
  /** @type {Device[]} */
  #all = [];
  #you = '';
  #drawn = '';
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #next;

  /** @param {HTMLElement} place @param {HTMLDetailsElement} group @param {Say} say @param {(text: string) => void} head */
  constructor(place, group, say, head) {
    this.group = group;
    this.say = say;
    this.head = head;
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.list = html('ul', { class: 'devices', 'aria-label': 'Paired devices' });
    const another = html('button', { type: 'button', class: 'key wide', 'data-f': 'pair-another' }, icon('plus'), 'Pair another');
    this.removal = new Removal((device) => this.#remove(device));
    this.invitation = new Invitation();
    listen(another, 'click', () => this.invitation.open());
    listen(this.list, 'click', (event) => this.#pressed(event));
    listen(group, 'toggle', () => this.start());
    place.replaceChildren(this.bad, this.list, html('div', { class: 'keys' }, another));
  }

  start() {
    clearTimeout(this.#next);
    if (this.group.open) this.#ask();
  }

  async #ask() {
    clearTimeout(this.#next);
    try {
      const { you, devices } = await request('/api/devices');
      this.#you = you;
      this.#all = devices;
      setText(this.bad, '');
      this.head(counted(devices.length, 'device'));
    } catch (error) {
      setSentence(this.bad, sentenceOf(error));
    }
    this.#draw();
    if (this.group.open) this.#next = setTimeout(() => this.#ask(), ASK_MS);
  }

  #draw() {
    const now_ms = Date.now();
    const key = JSON.stringify([this.#you, this.#all.map((device) => [device.id, device.name, device.role, seenWords(device, now_ms)])]);
    if (key === this.#drawn) return;
    this.#drawn = key;
    const at = document.activeElement instanceof HTMLElement && this.list.contains(document.activeElement) ? document.activeElement.dataset['key'] : undefined;
    this.list.replaceChildren(...this.#all.map((device) => this.#row(device, now_ms)));
    if (at) /** @type {HTMLElement | null} */ (this.list.querySelector(`[data-key="${CSS.escape(at)}"]`))?.focus();
  }

  /** @param {Device} device @param {number} now_ms */
  #row(device, now_ms) {
    const isYou = device.id === this.#you;
    const about = html('span', { class: 'm' });
    setSentence(about, seenWords(device, now_ms));
    return html('li', { 'data-id': device.id },
      html('span', { class: 'tx' }, html('bdi', { class: 't' }, device.name), ...(isYou ? [html('span', { class: 'tag' }, 'This device')] : []), about),
      html('div', { class: 'seg', role: 'group', 'aria-label': `Role of ${device.name}` }, ...ROLES.map(([role, label]) => html('button', {
        type: 'button', 'data-role-key': role, 'data-key': `${device.id} ${role}`, 'aria-pressed': String(device.role === role),
      }, label))),
      html('button', { type: 'button', class: 'key', 'data-f': 'remove', 'data-key': `${device.id} remove`, 'aria-label': `Remove ${device.name}` }, icon('trash')));
  }

  /** @param {Event} event */
  #pressed(event) {
    const key = /** @type {HTMLElement | null} */ (/** @type {HTMLElement} */ (event.target).closest('button'));
    const id = key?.closest('li')?.dataset['id'];
    const device = this.#all.find((one) => one.id === id);
    if (!key || !device) return;
    const role = key.dataset['roleKey'];
    if (role && role !== device.role) this.#change(device, role);
    else if (!role) this.removal.open(device, removalWords(device, this.#you, this.#all));
  }

  /** @param {Device} device @param {string} role */
  async #change(device, role) {
    try {
      await request(`/api/devices/${encodeURIComponent(device.id)}`, { method: 'PATCH', body: { role } });
    } catch (error) {
      this.say(sentenceOf(error), 'Role not changed');
    }
    this.#ask();
  }

  /** @param {Device} device */
  async #remove(device) {
    try {
      await request(`/api/devices/${encodeURIComponent(device.id)}`, { method: 'DELETE' });
      this.say('It has no access now, and its pages are closed.', `${device.name} removed`);
    } catch (error) {
      this.say(sentenceOf(error), 'Not removed');
    }
    this.#ask();
  }
}

/** The question before a removal. */
class Removal {
  /** @type {Device | null} */
  #device = null;

  /** @param {(device: Device) => void} act */
  constructor(act) {
    this.title = html('span', { id: 'removal-title' });
    this.text = html('p', { id: 'removal-words' });
    const yes = html('button', { type: 'button', class: 'main', 'data-f': 'yes' }, 'Remove');
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-removal', role: 'alertdialog', 'aria-labelledby': 'removal-title', 'aria-describedby': 'removal-words' },
      html('div', { class: 'bd' }, html('h2', {}, icon('trash'), this.title), this.text),
      html('div', { class: 'keys' }, yes, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Keep it'))));
    addSheet(this.sheet);
    listen(yes, 'click', () => {
      closeSheet(this.sheet);
      if (this.#device) act(this.#device);
    });
  }

  /** @param {Device} device @param {[string, string]} question title and text */
  open(device, [title, text]) {
    this.#device = device;
    setText(this.title, title);
    setText(this.text, text);
    openSheet(this.sheet);
  }
}

/** The QR code and the PIN for one more device. */
class Invitation {
  /** @type {'viewer' | 'operator'} */
  #role = 'viewer';
  #until_ms = 0;
  #count = 0;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #ticking;

  constructor() {
    this.roles = ROLES.map(([role, label]) => html('button', { type: 'button', 'data-role-key': role, 'aria-pressed': 'false' }, label));
    this.state = html('p', { class: 'small', role: 'status', id: 'invite-state' });
    this.code = /** @type {HTMLImageElement} */ (html('img', { class: 'qr', alt: 'QR code of the pairing link', hidden: true, width: 240, height: 240 }));
    this.pin = html('p', { class: 'pin-shown n', 'data-f': 'invite-pin' });
    this.sheet = /** @type {HTMLDialogElement} */ (html('dialog', { class: 'sheet scrimmed', id: 'sheet-invite', 'aria-labelledby': 'invite-title', 'aria-describedby': 'invite-state' },
      html('div', { class: 'bd' }, html('h2', { id: 'invite-title' }, icon('phone'), 'Pair another'),
        html('div', { class: 'seg', role: 'group', 'aria-label': 'Its role' }, ...this.roles), this.code, this.pin, this.state),
      html('div', { class: 'keys' }, html('button', { type: 'button', class: 'key', 'data-f': 'no' }, 'Close'))));
    addSheet(this.sheet);
    for (const key of this.roles) listen(key, 'click', () => this.#ask(key.dataset['roleKey'] === 'operator' ? 'operator' : 'viewer'));
    listen(this.sheet, 'close', () => clearInterval(this.#ticking));
  }

  open() {
    openSheet(this.sheet);
    this.#ask('viewer');
  }

  /** @param {'viewer' | 'operator'} role */
  async #ask(role) {
    this.#role = role;
    for (const key of this.roles) key.setAttribute('aria-pressed', String(key.dataset['roleKey'] === role));
    clearInterval(this.#ticking);
    show(this.code, false);
    setText(this.pin, '');
    setText(this.state, 'Loading from the server…');
    this.#count += 1;
    const mine = this.#count;
    try {
      const { pin, qr, expires_in_s } = await request('/api/devices/invite', { method: 'POST', body: { role } });
      if (mine !== this.#count) return;
      this.code.src = qr;
      show(this.code, true);
      setText(this.pin, pinShown(pin));
      this.#until_ms = performance.now() + expires_in_s * 1000;
      this.#tick();
      this.#ticking = setInterval(() => this.#tick(), 1000);
    } catch (error) {
      if (mine === this.#count) setSentence(this.state, sentenceOf(error));
    }
  }

  #tick() {
    const left_s = (this.#until_ms - performance.now()) / 1000;
    if (left_s <= 0) {
      clearInterval(this.#ticking);
      show(this.code, false);
      setText(this.pin, '');
      setText(this.state, 'Expired: choose the role again for a new code.');
      return;
    }
    const does = this.#role === 'operator' ? 'It can then act as an operator' : 'It can then watch, but not make changes';
    setSentence(this.state, `Scan the code with the other phone, or type the PIN there. For one phone, for ${leftWords(left_s)}. ${does}.`);
  }
}
