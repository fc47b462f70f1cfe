// Style sheets that are fetched with the first part of the page that needs them.

import { html } from './dom.js';

/** A sheet that takes longer is not waited for: over a half-open connection neither an answer nor an error comes [ms]. */
const WAITS_MS = 1500;
/** What several parts share: their rules come before those of one part. */
const SHARED = ['drawers', 'drive', 'menu', 'mode', 'replay', 'sources', 'wall'];
/** By address. @type {Map<string, Promise<void>>} */
const fetched = new Map();

/** Fetches it once. Rejects where it can't be loaded; the next call tries again. @param {string} href @returns {Promise<void>} */
export function fetchStyle(href) {
  const known = fetched.get(href);
  if (known) return known;
  // Its place in the cascade, whenever it arrives: what several parts share comes first, then each by its name.
  const name = href.replace(/.*\/|[-.].*/g, '');
  const place = `${SHARED.includes(name) ? 0 : 1}${name}`;
  const link = /** @type {HTMLLinkElement} */ (html('link', { rel: 'stylesheet', href, 'data-place': place }));
  /** @type {Promise<void>} */
  const loaded = new Promise((resolve, reject) => {
    link.onload = () => resolve();
    link.onerror = () => {
      fetched.delete(href);
      link.remove();
      reject(new Error(`${href} could not be loaded`));
    };
    document.head.insertBefore(link, [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll('[data-place]'))].find(({ dataset }) => (dataset['place'] ?? '') > place) ?? null);
  });
  fetched.set(href, loaded);
  return loaded;
}

/** Waits a moment for a sheet of static/css; without it a part lacks its look, not its truth. Resolves with whether it may still come. @param {string} name @returns {Promise<boolean>} */
export function styled(name) {
  const late = /** @type {Promise<boolean>} */ (new Promise((resolve) => { setTimeout(resolve, WAITS_MS, true); }));
  return Promise.race([fetchStyle(`/static/css/${name}.css`).then(() => true, () => false), late]);
}
