// The groups of the Settings tab that are fetched when they are opened: what each is called, and what fills it.

import { FetchedGroup } from './fetched-group.js';
import { html } from '../core/dom.js';

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {(sentence: string, title?: string) => void} Say
 */

/** Under a heading of its own: it is the server's, not the car's. @param {Say} say */
export function mailGroup(say) {
  const names = 'e-mail mail SMTP host port security STARTTLS TLS user password sender name allowed recipients domains size limit link certificate test outbox';
  const group = new FetchedGroup('mail', 'E-mail', names, async (place, _, head) => (await import('../files/mail-settings.js')).mount(place, say, head));
  const [whose, of] = isOfAgent() ? ['Agent', 'of this car'] : ['Server', 'for all its vehicles'];
  group.element = html('section', { 'aria-label': 'E-mail' }, html('div', { class: 'sec' }, html('span', {}, whose), html('span', {}, of)), group.group);
  return group;
}

/** @param {Store} store @param {Say} say */
export function peopleGroup(store, say) {
  const names = 'people persons names initials on duty shift sign on off role operator safety driver supervisor test engineer hand over';
  return new FetchedGroup('people', 'People', names, async (place, group, head) => (await import('../control/people-list.js')).mount(place, group, store, say, head));
}

/** @param {Store} store */
export function departureGroup(store) {
  const names = 'departure check list items checklist before driving pre-drive sign brake steering recorder sound clock disk';
  return new FetchedGroup('departure', 'Departure check', names, async (place, _, head) => (await import('../drive/departure-list.js')).mount(place, store, head), { isEachTime: true });
}

/** @param {Store} store @param {Say} say */
export function devicesGroup(store, say) {
  const names = 'paired devices phones pair another QR code PIN link role viewer operator remove revoke access who';
  const isThere = document.documentElement.dataset['access'] === 'paired';
  return new FetchedGroup('devices', 'Paired devices', names, async (place, group, head) => (await import('../pairing/devices.js')).mount(place, group, store, say, head), { isThere });
}

/** Whether each car's own agent sends its mail. */
export const isOfAgent = () => document.documentElement.dataset['kept'] === 'agents';
