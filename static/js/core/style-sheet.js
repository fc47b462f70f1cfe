// Style sheets that are fetched with the first part of the page that needs them.

import { html } from './dom.js';

/** A sheet that takes longer is not waited for: over a half-open connection neither an answer nor an error comes [ms]. */
const WAITS_MS = 1500;
/** By address. @type {Map<string, Promise<void>>} */
const fetched = new Map();

/** Fetches it once. Rejects where it can't be loaded; the next call tries again. @param {string} href @returns {Promise<void>} */
export function fetchStyle(href) {
  const known = fetched.get(href);
  if (known) return known;
  const link = /** @type {HTMLLinkElement} */ (html('link', { rel: 'stylesheet', href }));
  /** @type {Promise<void>} */
  const loaded = new Promise((resolve, reject) => {
    link.onload = () => resolve();
    link.onerror = () => {
      fetched.delete(href);
      link.remove();
      reject(new Error(`The style sheet ${href} could not be loaded`));
    };
    document.head.append(link);
  });
  fetched.set(href, loaded);
  return loaded;
}

/** Waits a moment for a sheet of static/css; without it a part lacks its look, not its truth. @param {string} name @returns {Promise<void>} */
export function styled(name) {
  const late = /** @type {Promise<void>} */ (new Promise((resolve) => { setTimeout(resolve, WAITS_MS); }));
  return Promise.race([fetchStyle(`/static/css/${name}.css`).catch(() => {}), late]);
}
