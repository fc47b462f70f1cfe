// The style of everything about mail, fetched with the first of it.

import { html } from '../core/dom.js';

/** @returns {Promise<void>} */
export function styled() {
  if (document.querySelector('link[data-mail]')) return Promise.resolve();
  return new Promise((resolve) => {
    const link = html('link', { rel: 'stylesheet', href: '/static/css/mail.css', 'data-mail': '' });
    link.addEventListener('load', () => resolve());
    link.addEventListener('error', () => resolve()); // it lacks beauty, not truth
    document.head.append(link);
  });
}
