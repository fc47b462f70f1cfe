// License and About: what this is, which versions run, and whose work is in it.

import { html, setText, textNodes } from '../core/dom.js';
import { fixed } from '../core/format.js';

/**
 * @typedef {{name: string, version: string, license: string, where: string}} Part
 * @typedef {{version: string, python: string, system: string, parts: Part[]}} About
 * @typedef {import('../core/store.js').Store} Store
 */

/** @returns {Promise<About>} */
async function ask() {
  const answer = await fetch('/api/about', { cache: 'no-store' });
  if (!answer.ok) throw new Error(String(answer.status));
  return answer.json();
}

/** @param {HTMLElement} root */
export function mountLicense(root) {
  const own = text('catgraph: Apache License 2.0', '/static/license.txt', 'The full text could not be loaded; it is in the project’s file LICENSE.');
  const list = html('ul', { class: 'parts' });
  const status = html('p', { role: 'status' }, 'Loading the list…');
  root.replaceChildren(html('div', { class: 'prose' },
    html('p', {}, html('b', {}, 'catgraph is free software under the Apache License, version 2.0.'), ' It comes without any warranty.'),
    html('p', {}, 'Its numerals and icons have the same licence.')), own,
  html('div', { class: 'sec' }, html('span', {}, 'Third-party parts')), html('div', { class: 'prose' }, status), list);
  let isShown = true;
  ask().then(({ parts }) => {
    if (!isShown) return;
    const [page, server] = ['page', 'server'].map((where) => parts.filter((part) => part.where === where).length);
    setText(status, `${page} in the page, ${server} in the server. Press one for its licence.`);
    list.replaceChildren(...parts.map((part) => html('li', {}, text(`${part.name} ${part.version}: ${part.license}`, `/api/notices/${encodeURIComponent(part.name)}`, 'The text could not be loaded. Close and open it to try again.'))));
  }, () => { if (isShown) setText(status, 'The server did not send the list. Go back and try again.'); });
  return () => {
    isShown = false;
    root.replaceChildren();
  };
}

/**
 * A text that is fetched when it is opened.
 * @param {string} title
 * @param {string} address
 * @param {string} failed
 */
function text(title, address, failed) {
  const pre = html('pre', { class: 'license', tabindex: 0 });
  const details = /** @type {HTMLDetailsElement} */ (html('details', { class: 'notice' }, html('summary', {}, title), pre));
  let has = false;
  details.addEventListener('toggle', () => {
    if (!details.open || has) return;
    setText(pre, 'Loading the text…');
    fetch(address).then((answer) => (answer.ok ? answer.text() : Promise.reject())).then(
      (found) => {
        has = true;
        setText(pre, found);
      },
      () => setText(pre, failed),
    );
  });
  return details;
}

/**
 * @param {HTMLElement} root
 * @param {Store} store
 */
export function mountAbout(root, store) {
  const facts = html('dl', { class: 'facts' });
  root.replaceChildren(html('div', { class: 'prose' },
    html('p', {}, html('b', {}, 'catgraph monitors an autonomous test car and raises alarms.')),
    html('p', {}, 'It has an aid to slow the car down. It is not an emergency stop: the safety driver stops the car.'),
    html('p', {}, 'The values are the car’s; an old, unknown or unchecked value is marked as such.')), facts);
  /** @type {About | null} */
  let about = null;
  let isShown = true;
  ask().then((answer) => {
    about = answer;
    if (isShown) draw();
  }, () => {}); // its rows stay away

  function draw() {
    const { frame } = store;
    if (!frame) return;
    const version = (/** @type {string} */ name) => about?.parts.find((part) => part.name === name)?.version ?? NOT_KNOWN;
    const rows = [
      ['Version', frame.server.version], ['This page', document.documentElement.dataset['version'] ?? NOT_KNOWN], ['Server', location.host],
      ['Vehicle', frame.vehicle ?? '–'], ['Address', frame.session.address ?? 'none'],
      ['ROS', frame.session.ros_version === null ? 'unknown' : String(frame.session.ros_version)],
      ['Vehicle profile', frame.session.profile ?? 'unknown'], ['Pages', String(frame.server.pages)], ['Frames skipped', String(frame.server.frames_skipped)],
      ['Server behind', `${fixed(frame.server.loop_lag_ms, 1)} ms`], ['Run', frame.server.boot.slice(0, 8)],
      ['Without the server', KEEPING[document.documentElement.dataset['shell'] ?? ''] ?? 'not known yet'],
      ['Python', about ? `${about.python}, ${about.system}` : NOT_KNOWN],
      ...['roslibpy', 'fastapi', 'uvicorn', 'numpy', 'Leaflet', 'uPlot'].map((name) => [name, version(name)]),
    ];
    const key = JSON.stringify(rows);
    if (facts.dataset['key'] === key) return;
    facts.dataset['key'] = key;
    facts.replaceChildren(...rows.flatMap(([term = '', value = '']) => [html('dt', {}, term), html('dd', {}, ...textNodes(value))]));
  }

  draw();
  const stop = store.on('draw', draw);
  return () => {
    isShown = false;
    stop();
    root.replaceChildren();
  };
}
const NOT_KNOWN = '–';
/** What of this page the phone keeps; shell.js finds out. @type {Record<string, string>} */
const KEEPING = {
  kept: 'this device reports it: it stores the page’s shell',
  missing: 'the browser’s own error: it cannot store the page, or the page has no HTTPS',
  refused: 'the browser’s own error: it stored nothing, for example because it does not trust the certificate',
  off: 'the browser’s own error: this server does not allow phones to store the page',
};
