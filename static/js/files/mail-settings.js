// How this server sends mail: host, login, sender, who may be written to. Saved as a whole, tried with a key; the password goes one way.

import { decimalOf, local } from '../core/decimal.js';
import { keptAt } from '../core/kept-at.js';
import { request, sentenceOf } from '../control/request.js';
import { html, icon, listen, setAttribute, setText, setSentence, show } from '../core/dom.js';
import { recipientsOf } from './mail-layout.js';
import { styled } from '../core/style-sheet.js';
import { openOutbox } from './outbox.js';

/**
 * @typedef {object} MailSettings as GET /api/mail/settings answers
 * @property {string} host
 * @property {number} port
 * @property {'starttls' | 'tls' | 'none'} security
 * @property {string} user
 * @property {boolean} has_password
 * @property {string} sender
 * @property {string} sender_name
 * @property {string[]} allowed
 * @property {string[]} report_to
 * @property {number} limit_mb
 * @property {string} link_base
 * @property {string} ca
 * @property {boolean} is_complete
 * @property {string[]} complaints
 */

const SECURITY = /** @type {const} */ ([['starttls', 'STARTTLS', 587], ['tls', 'TLS', 465], ['none', 'None', 25]]);
const PORTS = SECURITY.map(([, , port]) => port);

/**
 * @param {HTMLElement} place
 * @param {(sentence: string, title?: string) => void} say
 * @param {(text: string) => void} head shows the state in the group's summary
 */
export async function mount(place, say, head) {
  const at = keptAt('/api/mail');
  const [settings] = await Promise.all([request(`${at}/settings`), styled('mail')]);
  const form = new MailForm(say, head, at);
  place.replaceChildren(form.element);
  form.show(settings);
}

class MailForm {
  #security = 'starttls';
  #isChanged = false;

  /** @param {(sentence: string, title?: string) => void} say @param {(text: string) => void} head @param {string} at the address of the mail that it sets */
  constructor(say, head, at) {
    this.at = at;
    this.head = head;
    const line = (/** @type {string} */ name, /** @type {import('../core/dom.js').Attributes} */ more = {}) => /** @type {HTMLInputElement} */ (html('input', { id: `mail-set-${name}`, 'data-mail-field': name, type: 'text', autocomplete: 'off', autocapitalize: 'off', autocorrect: 'off', spellcheck: 'false', ...more }));
    const label = (/** @type {string} */ name, /** @type {string} */ text) => html('label', { for: `mail-set-${name}` }, text);
    this.host = line('host', { maxlength: 253, placeholder: 'smtp.example.org', inputmode: 'url' });
    this.port = line('port', { maxlength: 5, inputmode: 'numeric', class: 'n' });
    this.security = SECURITY.map(([name, text]) => html('button', { type: 'button', 'data-security': name, 'aria-pressed': 'false' }, text));
    this.user = line('user', { maxlength: 320, autocomplete: 'username', placeholder: 'none: no login' });
    this.password = line('password', { type: 'password', maxlength: 500, autocomplete: 'new-password', 'aria-describedby': 'mail-set-password-help' });
    this.sender = line('sender', { maxlength: 320, inputmode: 'email', placeholder: 'car@example.org' });
    this.senderName = line('sender_name', { maxlength: 100, autocapitalize: 'on' });
    this.allowed = /** @type {HTMLTextAreaElement} */ (html('textarea', { id: 'mail-set-allowed', 'data-mail-field': 'allowed', rows: 2, maxlength: 20_000, autocapitalize: 'off', spellcheck: 'false', placeholder: 'example.org\nann@example.com', 'aria-describedby': 'mail-set-allowed-help' }));
    this.reportTo = line('report_to', { maxlength: 2000, inputmode: 'email', placeholder: 'off', 'aria-describedby': 'mail-set-report-help' });
    this.limit = line('limit_mb', { maxlength: 6, inputmode: 'decimal', class: 'n', 'aria-describedby': 'mail-set-limit-help' });
    this.linkBase = line('link_base', { maxlength: 300, inputmode: 'url', placeholder: location.origin, 'aria-describedby': 'mail-set-link-help' });
    this.ca = /** @type {HTMLTextAreaElement} */ (html('textarea', { id: 'mail-set-ca', 'data-mail-field': 'ca', class: 'pem', rows: 3, maxlength: 32_768, autocapitalize: 'off', spellcheck: 'false', placeholder: '-----BEGIN CERTIFICATE-----', 'aria-describedby': 'mail-set-ca-help' }));
    this.passwordHelp = html('p', { class: 'mail-hint', id: 'mail-set-password-help' });
    this.bad = html('p', { class: 'bad', role: 'alert' });
    this.good = html('p', { class: 'good', role: 'status' });
    this.save = html('button', { type: 'button', class: 'key wide solid', 'data-f': 'mail-save' }, 'Save');
    this.to = line('test', { maxlength: 320, inputmode: 'email', autocomplete: 'email', placeholder: 'you@example.org', 'aria-describedby': 'mail-set-test-help' });
    this.test = html('button', { type: 'button', class: 'key wide', 'data-f': 'mail-test' }, icon('mail'), 'Test');
    const outbox = html('button', { type: 'button', class: 'key wide', 'data-f': 'mail-outbox' }, icon('files'), 'Outbox');
    const hint = (/** @type {string} */ id, /** @type {string} */ text) => html('p', { class: 'mail-hint', id: `mail-set-${id}-help` }, text);
    this.element = html('div', { class: 'mail-form mail-settings' },
      html('div', { class: 'two' }, html('div', {}, label('host', 'SMTP host'), this.host), html('div', {}, label('port', 'Port'), this.port)),
      html('span', { class: 'lab', id: 'mail-set-security' }, 'Encrypted by'), html('div', { class: 'seg', role: 'group', 'aria-labelledby': 'mail-set-security' }, ...this.security),
      label('user', 'User'), this.user,
      label('password', 'Password'), this.password, this.passwordHelp,
      label('sender', 'Sender’s address'), this.sender,
      label('sender_name', 'Sender’s name'), this.senderName,
      label('allowed', 'Allowed recipients'), this.allowed, hint('allowed', 'Addresses, domains (example.org) or all below one (*.example.org). Empty: everyone.'),
      label('report_to', 'Mail each drive’s report to'), this.reportTo, hint('report', 'Sent by itself a minute after a drive has ended. Empty: off.'),
      label('limit_mb', 'Size limit of a mail, MB'), this.limit, hint('limit', 'Before encoding: 18 MB make a mail of 25 MB, which most providers accept.'),
      label('link_base', 'This server’s address in links'), this.linkBase, hint('link', 'Address at which recipients reach this server. Empty: the address of this page.'),
      label('ca', 'Certificate of the mail server’s own CA (PEM)'), this.ca, hint('ca', 'If set, only servers that it certifies are trusted. Empty: those that this computer trusts.'),
      this.bad, this.good, this.save,
      label('test', 'Send a test e-mail to'), this.to, hint('test', 'Empty: only the login is tested. The saved settings are tested.'),
      html('div', { class: 'pair' }, this.test, outbox));
    this.fields = [this.host, this.port, this.user, this.password, this.sender, this.senderName, this.allowed, this.reportTo, this.limit, this.linkBase, this.ca];
    for (const one of this.fields) listen(one, 'input', () => this.#changed());
    for (const key of this.security) listen(key, 'click', () => this.#secure(key.dataset['security'] ?? 'starttls'));
    listen(this.save, 'click', () => this.#save());
    listen(this.test, 'click', () => this.#test());
    listen(outbox, 'click', () => openOutbox(say));
  }

  /** @param {MailSettings} settings */
  show(settings) {
    this.host.value = settings.host;
    this.port.value = String(settings.port);
    this.user.value = settings.user;
    this.password.value = '';
    this.sender.value = settings.sender;
    this.senderName.value = settings.sender_name;
    this.allowed.value = settings.allowed.join('\n');
    this.reportTo.value = (settings.report_to ?? []).join(', ');
    this.limit.value = local(String(settings.limit_mb));
    this.linkBase.value = settings.link_base;
    this.ca.value = settings.ca;
    this.password.placeholder = settings.has_password ? 'stored on the server' : 'none';
    setText(this.passwordHelp, settings.has_password ? 'It is never shown. Leave empty to keep it.' : 'It is stored on the server and never shown.');
    this.#security = settings.security;
    this.#isChanged = false;
    this.#draw();
    setSentence(this.bad, settings.complaints.join(' '));
    this.head(settings.is_complete ? settings.host : 'not set up');
  }

  #changed() {
    this.#isChanged = true;
    setText(this.bad, '');
    setText(this.good, '');
    for (const one of this.fields) setAttribute(one, 'aria-invalid', null);
    this.#draw();
  }

  /** The usual port goes with it, where no other was typed. @param {string} name */
  #secure(name) {
    this.#security = name;
    const usual = SECURITY.find(([one]) => one === name)?.[2];
    if (usual && (this.port.value === '' || PORTS.includes(/** @type {25} */ (Number(this.port.value))))) this.port.value = String(usual);
    this.#changed();
  }

  #draw() {
    for (const key of this.security) key.setAttribute('aria-pressed', String(key.dataset['security'] === this.#security));
    setText(this.save, this.#isChanged ? 'Save' : 'Saved');
    setAttribute(this.save, 'disabled', !this.#isChanged);
    setAttribute(this.test, 'disabled', this.#isChanged);
    show(this.good, true);
  }

  async #save() {
    const port = Number(this.port.value);
    const limit = decimalOf(this.limit.value);
    if (!Number.isInteger(port) || this.port.value.trim() === '') {
      this.#refuse('The port is a number from 1 to 65535.', 'port');
      return;
    }
    if (!Number.isFinite(limit) || this.limit.value.trim() === '') {
      this.#refuse('The size limit must be a number of MB.', 'limit_mb');
      return;
    }
    const user = this.user.value.trim();
    const body = {
      host: this.host.value.trim(), port, security: this.#security, user, sender: this.sender.value.trim(), sender_name: this.senderName.value.trim(),
      allowed: recipientsOf(this.allowed.value), report_to: recipientsOf(this.reportTo.value), limit_mb: limit, link_base: this.linkBase.value.trim(), ca: this.ca.value.trim(),
      ...(this.password.value ? { password: this.password.value } : {}),
    };
    setAttribute(this.save, 'disabled', true);
    try {
      this.show(await request(`${this.at}/settings`, { method: 'PUT', body }));
      setText(this.good, 'Saved. Try it with Test.');
    } catch (error) {
      this.#refuse(sentenceOf(error), '');
      setAttribute(this.save, 'disabled', null);
    }
  }

  async #test() {
    setAttribute(this.test, 'disabled', true);
    setText(this.bad, '');
    setText(this.good, 'Connecting to the mail server. This takes a few seconds.');
    const to = this.to.value.trim();
    try {
      const { sentence, said: reply } = await request(`${this.at}/test`, { method: 'POST', body: to ? { to } : {} });
      setSentence(this.good, reply ? `${sentence} Server reply: ${reply}` : sentence);
    } catch (error) {
      setText(this.good, '');
      setSentence(this.bad, sentenceOf(error));
    }
    setAttribute(this.test, 'disabled', this.#isChanged);
  }

  /** @param {string} sentence @param {string} name of the field at fault */
  #refuse(sentence, name) {
    setSentence(this.bad, sentence);
    const at = this.fields.find((one) => one.dataset['mailField'] === name);
    if (!at) return;
    setAttribute(at, 'aria-invalid', 'true');
    at.focus();
  }
}
