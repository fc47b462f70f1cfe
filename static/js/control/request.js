// Requests to the server over HTTP, with the name of this page.

import { keptAt } from '../core/kept-at.js';
import { ownName } from './own-name.js';

const SILENT = 'The server does not answer.';

/**
 * Sends a request to the server; a refusal is an Error with its reason.
 * @param {string} path
 * @param {{method?: string, body?: object, signal?: AbortSignal}} [how]
 * @returns {Promise<any>}
 */
export async function request(path, { method = 'GET', body, signal } = {}) {
  /** @type {Response} */
  let answer;
  try {
    answer = await fetch(keptAt(path), {
      method, cache: 'no-cache', ...(signal ? { signal } : {}), ...(body ? { body: JSON.stringify(body) } : {}),
      headers: { 'x-catgraph-page': ownName(), ...(body ? { 'content-type': 'application/json' } : {}) }, // who is on duty at a page of the server's own machine
    });
  } catch (error) {
    if (error instanceof DOMException && error.name === 'AbortError') throw error;
    throw new Error(SILENT);
  }
  const answered = await answer.json().catch(() => null);
  if (!answer.ok) throw Object.assign(new Error(typeof answered?.detail === 'string' ? answered.detail : `The server refused the request (${answer.status}).`), { status: answer.status });
  return answered;
}

/** @param {unknown} error */
export const sentenceOf = (error) => (error instanceof Error ? error.message : SILENT);
