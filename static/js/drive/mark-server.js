// Commands and uploads to the server for the marks of this phone, and its answers.

import { keptAt } from '../core/kept-at.js';
import { ownName } from '../control/own-name.js';

/** @typedef {import('../core/store.js').Store} Store */

/** @param {Store} store */
export function isThere(store) {
  return store.frame !== null && !store.isSilent && store.socket.isOpen && !store.unserved;
}

/** The address of a voice or a photo of a mark of the live drive. @param {string} id @param {'voice' | 'photo'} part @param {string} vehicle */
export function partOf(id, part, vehicle) {
  return keptAt(`/api/marks/${encodeURIComponent(id)}/${part}?${new URLSearchParams({ vehicle })}`);
}

/** The server did not get so far as to judge what it was sent; 507: it did, and has no room. @param {number} status */
export function isForNow(status) {
  return status === 429 || (status >= 500 && status !== 507);
}

/** Why it was not stored; the bare words of HTTP say nothing. @param {number} status @param {unknown} detail */
export function reasonOf(status, detail) {
  if (typeof detail === 'string' && detail !== 'Not Found') return detail;
  return status === 404 ? 'This server cannot store it (404).' : `The server refused it (${status}).`;
}

/** @param {Store} store @returns {import('./mark-delivery.js').Server} */
export function serverOf(store) {
  const delivered = (/** @type {import('../core/requests.js').Answer} */ { ok, reason, outcome }) => ({ ok, isLost: !ok && outcome !== undefined && outcome !== 'refused', reason: reason ?? '' });
  return {
    isThere: () => isThere(store),
    vehicle: () => store.vehicle,
    mark: async (fields, within_ms) => delivered(await store.ask('mark', fields, within_ms)),
    remove: async (mark, vehicle, within_ms) => delivered(await store.ask('remove_mark', { mark, vehicle }, within_ms)),
    upload: async (id, vehicle, part, blob, type, within_ms) => {
      try {
        const answer = await fetch(partOf(id, part, vehicle), {
          method: 'POST', body: blob, cache: 'no-store', signal: AbortSignal.timeout(within_ms), headers: { 'content-type': type, 'x-catgraph-page': ownName() },
        });
        if (answer.ok) return { ok: true, isLost: false, reason: '' };
        const body = await answer.json().catch(() => null);
        return { ok: false, isLost: isForNow(answer.status), reason: reasonOf(answer.status, body?.detail) };
      } catch {
        return { ok: false, isLost: true, reason: '' };
      }
    },
  };
}
