// The text of each phone that shares its position, and which of them is compared with the car: pure functions.

import { placeOf } from '../core/geodesy.js';
import { age, fixed } from '../core/format.js';

/**
 * @typedef {import('../core/protocol-types.js').PhoneListed} PhonePlace
 * @typedef {import('../core/protocol-types.js').State} State
 */

/** A fix older than this tells where a phone was, not where it is; as the server has it [s]. */
const LIVES_S = 5;

/** How a phone is called here. @param {Pick<PhonePlace, 'id' | 'label'>} phone @param {string} page this page */
export function nameOf(phone, page) {
  return phone.id === page ? 'You' : (phone.label ?? 'A phone');
}

/**
 * One phone's row.
 * @param {PhonePlace} phone
 * @param {number} lag_s
 * @param {string} page
 */
export function phoneRow(phone, lag_s, page) {
  const age_s = phone.age_s === null ? null : phone.age_s + lag_s;
  const fix = phone.accuracy_m === null || age_s === null ? 'No GPS fix yet' : `Accurate to ${fixed(phone.accuracy_m, 0)} m, ${age(age_s)} s ago`;
  const text = `${phone.why_text || fix}.`;
  const tag = phone.chosen ? 'In the car' : phone.compared ? 'Used' : '';
  return { id: phone.id, name: nameOf(phone, page), text, tag, isChosen: phone.chosen === true };
}

/** In one line: how many phones, and which is compared. @param {State} frame @param {string} page */
export function phonesLine(frame, page) {
  const phones = frame.phones ?? [];
  const compared = phones.find((one) => one.compared);
  const many = phones.length === 1 ? '1 phone shares its position' : `${phones.length} phones share their position`;
  if (!compared) return { text: many, why: '' };
  const isMine = compared.id === page;
  const name = nameOf(compared, page);
  return { text: many, why: compared.chosen ? `${isMine ? 'Yours' : name} is in the car` : `Using ${isMine ? 'yours' : name}. Choose the phone in the car` };
}

/**
 * The phones beside the one that is compared, as the map shows them.
 * @param {State} frame
 * @param {number} lag_s
 * @param {string} page
 */
export function othersOn(frame, lag_s, page) {
  return (frame.phones ?? []).filter((one) => !one.compared).flatMap((one) => {
    const place = placeOf(one);
    if (!place) return [];
    const age_s = one.age_s === null ? Infinity : one.age_s + lag_s;
    const isLive = (one.used || one.why === 'coarse') && age_s <= LIVES_S;
    const name = nameOf(one, page);
    return [{ id: one.id, place, isLive, accuracy_m: one.accuracy_m, label: isLive ? `${name} ±${fixed(one.accuracy_m ?? 0, 0)} m` : `${name} STALE ${age(Number.isFinite(age_s) ? age_s : null)} s` }];
  });
}
