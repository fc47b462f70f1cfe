// The style of the pairing screen, of the list of devices and of what a viewer sees, fetched with the first of them.

import { html } from '../core/dom.js';

/** @returns {Promise<void>} */
export function styled() {
  if (document.querySelector('link[data-access]')) return Promise.resolve();
  return new Promise((resolve) => {
    const link = html('link', { rel: 'stylesheet', href: '/static/css/access.css', 'data-access': '' });
    link.addEventListener('load', () => resolve());
    link.addEventListener('error', () => resolve()); // it lacks beauty, not truth
    document.head.append(link);
  });
}
