// The first screen: where the car is, and what this phone must allow before its alarms can be heard.

import { openPreferences } from './preferences.js';
import { closeSheet, openSheet } from './sheet.js';
import { field, html, icon, listen, need, setAttribute, setText, setWords, show } from './dom.js';
import { connectRow } from './slow-layout.js';
import { age } from './words.js';

const KEY = 'catgraph.addresses';
const KEPT = 8;
const LOOK_EVERY_MS = 5000;

/**
 * @typedef {import('./arming.js').Armed} Armed
 * @typedef {{name: string, address: string | null, phase?: string}} Found
 */

/**
 * How an item of the arming list stands.
 * @param {'sound' | 'screen' | 'position'} what
 * @param {Armed} state
 * @returns {{tag: string, kind: 'plain' | 'warn' | 'unk', cost: string}}
 */
export function armWords(what, state) {
  if (state === 'ready') return { tag: 'Ready', kind: 'plain', cost: '' };
  if (state === 'asks') return { tag: 'Asks', kind: 'unk', cost: '' };
  const cost = {
    sound: 'alarms are seen, not heard',
    screen: 'the phone may go dark and hide alarms',
    position: 'phone–car will not be checked',
  }[what];
  if (state === 'refused') return { tag: 'Refused', kind: 'warn', cost: `Refused: ${cost}` };
  const why = what === 'sound' ? 'This browser has no sound' : 'Needs HTTPS';
  return { tag: 'Not available', kind: 'warn', cost: `${why}: ${cost}` };
}

/**
 * Put an address in front of those used before, each once.
 * @param {string[]} before
 * @param {string} address
 */
export function remembered(before, address) {
  return [address, ...before.filter((one) => one !== address)].slice(0, KEPT);
}

/**
 * What GET /api/vehicles lists, each address once: found ones first, then those the server watches already.
 * @param {any} answer
 * @returns {Found[]}
 */
export function foundIn(answer) {
  const all = [...(Array.isArray(answer?.found) ? answer.found : []), ...(Array.isArray(answer?.vehicles) ? answer.vehicles : [])];
  const seen = new Set();
  return all.filter((one) => typeof one?.address === 'string' && one.address && !seen.has(bare(one.address)) && seen.add(bare(one.address)))
    .map((one) => ({ name: String(one.name ?? 'Vehicle'), address: one.address, phase: one.phase }));
}

/**
 * What stood when the server ended, and how to see it again.
 * @param {import('./protocol.js').Session['held']} held
 */
export function heldWords(held) {
  if (!held?.address || (!held.alarms && !held.paused)) return '';
  const alarms = held.alarms ? `${held.alarms} ${held.alarms === 1 ? 'alarm stood' : 'alarms stood'}` : '';
  const what = [alarms, held.paused ? 'monitoring was paused' : ''].filter(Boolean).join(' and ');
  return `The server was restarted while it watched ${bare(held.address)}: ${what}. Connect to it to go on.`;
}

/** As an operator writes it: without the scheme rosbridge has anyway. @param {string} address */
export function bare(address) {
  return address.replace(/^ws:\/\//, '').replace(/\/$/, '');
}

/** Do both name one rosbridge, the usual port written or not? @param {string} one @param {string} other */
export function isSameCar(one, other) {
  const [a, b] = [one, other].map((address) => bare(address.trim()).replace(/^(\[[^\]]*\]|[^:/]+)$/, '$1:9090'));
  return a === b;
}

/**
 * @param {HTMLElement} root
 * @param {import('./store.js').Store} store
 * @param {import('./page.js').Page} page
 * @param {import('./arming.js').Arming} arming
 */
export function mount(root, store, page, arming) {
  const at = (/** @type {string} */ name) => field(root, name);
  const input = /** @type {HTMLInputElement} */ (at('address'));
  const [says, list, go] = [at('says'), at('found'), at('go')];
  const historySheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-history'));
  /** @type {Found[] | null} */
  let found = null;
  let asked_ms = -Infinity;
  let isTyped = false;
  let offered = '';
  let isBusy = false;
  let wasSilent = false;
  let complaint = '';
  let shownFound = '';
  input.value = addresses()[0] ?? '';

  const stops = [
    listen(at('form'), 'submit', (event) => {
      event.preventDefault();
      connect();
    }),
    listen(input, 'input', () => {
      isTyped = true;
      complain('');
      drawFound();
    }),
    listen(at('history'), 'click', () => openHistory()),
    listen(at('settings'), 'click', openPreferences),
    listen(list, 'click', (event) => {
      const row = /** @type {HTMLElement | null} */ (event.target.closest('[data-address]'));
      if (row) choose(row.dataset['address'] ?? '');
    }),
    store.on('draw', draw),
    store.on('open', () => { asked_ms = -Infinity; }),
  ];

  /** @param {string} address */
  function choose(address) {
    input.value = bare(address);
    isTyped = true;
    complain('');
    drawFound();
  }

  async function connect() {
    arming.ask(); // within the tap, and before anything is waited for
    const address = input.value.trim();
    if (isBack()) {
      page.chosen();
      return;
    }
    isBusy = true;
    complain('');
    const answer = await store.ask('connect', { address });
    isBusy = false;
    if (address) keep(remembered(addresses(), address));
    page.suggestion = answer.suggestion ?? null;
    // A bad address opens the sheet of the failed connection, which says the same; what never went out is said here.
    if (!answer.ok && store.frame?.session.phase !== 'failed') complain(answer.reason ?? 'Refused.');
    isTyped = false;
    page.chosen();
  }

  /** Is the vehicle in the field being monitored all the while? Then nothing is dialled anew. */
  function isBack() {
    const address = store.frame?.session.address;
    return store.isMonitoring && typeof address === 'string' && isSameCar(address, input.value);
  }

  /** Is it the car the server was started for that would be dialled? */
  function isConfigured() {
    const configured = store.frame?.session.configured;
    const here = bare(input.value.trim());
    return typeof configured === 'string' && (here === '' || isSameCar(here, configured));
  }

  /** @param {string} sentence */
  function complain(sentence) {
    complaint = sentence;
    drawSays();
    setAttribute(input, 'aria-invalid', sentence !== '' || null);
  }

  function drawSays() {
    const sentence = complaint || heldWords(store.frame?.session.held);
    setWords(says, sentence);
    show(says, sentence !== '');
  }

  function openHistory() {
    const before = addresses();
    show(field(historySheet, 'none'), before.length === 0);
    field(historySheet, 'list').replaceChildren(...before.map((address) => {
      const button = html('button', { type: 'button' }, icon('clock'), html('span', { class: 'n' }, address));
      button.addEventListener('click', () => {
        choose(address);
        closeSheet(historySheet);
      });
      return html('li', {}, button);
    }));
    openSheet(historySheet);
  }

  async function look() {
    asked_ms = store.now();
    try {
      const answer = await fetch('/api/vehicles', { cache: 'no-store' });
      found = answer.ok ? foundIn(await answer.json()) : null;
    } catch {
      found = null;
    }
    drawFound();
  }

  function drawFound() {
    const here = bare(input.value.trim());
    const key = JSON.stringify([found, here]);
    if (key === shownFound) return;
    shownFound = key;
    if (!found?.length) {
      list.replaceChildren(html('li', { class: 'none' }, html('span', { class: 'm' },
        found ? 'None found. Enter the address of the car’s rosbridge.' : 'The server gives no list.')));
      return;
    }
    list.replaceChildren(...found.map((one) => {
      const address = bare(one.address ?? '');
      const row = html('button', { type: 'button', 'data-address': address }, icon('car'), html('span', { class: 't' }, one.name),
        html('span', { class: 'm' }, html('span', { class: 'n' }, address), one.phase && one.phase !== 'idle' ? ` · ${one.phase}` : ''));
      if (address === here) row.append(html('span', { class: 'r' }, icon('ok')));
      return html('li', {}, row);
    }));
  }

  function draw() {
    if (root.hidden) return;
    if (store.now() - asked_ms > LOOK_EVERY_MS) look();
    const { frame } = store;
    const session = frame?.session;
    // What is dialled, or the car the server was started for, comes before what was typed on this phone some day;
    // what names the same car stays as the operator wrote it.
    const address = session?.address ?? session?.configured ?? '';
    if (!isTyped && document.activeElement !== input && address && address !== offered && !isSameCar(address, input.value)) input.value = bare(address);
    offered = address;
    const isDialling = isBusy || session?.phase === 'connecting';
    const isSame = session?.address ? isSameCar(session.address, input.value) : false;
    setAttribute(go, 'data-busy', isDialling && (isSame || isBusy));
    setWords(go, isDialling && (isSame || isBusy) ? `Connecting ${age(frame?.link.trying_for_s ?? 0)} s` : isBack() ? 'Back to monitoring' : isConfigured() ? `Connect to ${frame?.vehicle}` : 'Connect and arm alarms');
    if (store.isSilent !== wasSilent) complain(store.isSilent ? 'The server does not answer; this page keeps trying.' : '');
    wasSilent = store.isSilent;
    drawSays();
    const { arms } = arming;
    for (const what of /** @type {const} */ (['sound', 'screen', 'position'])) {
      const words = armWords(what, arms[what]);
      tag(at(what), words.tag, words.kind);
      setText(at(`${what}-cost`), words.cost);
    }
    const slow = connectRow(frame?.decelerate, store.isMonitoring);
    tag(at('slowdown'), slow.tag, slow.kind);
    setText(at('slowdown-cost'), slow.cost);
  }

  show(at('insecure'), !window.isSecureContext);
  drawFound();
  draw();
  return () => stops.forEach((stop) => stop());
}

/**
 * @param {HTMLElement} element
 * @param {string} word
 * @param {'plain' | 'warn' | 'unk'} kind
 */
function tag(element, word, kind) {
  const key = `${kind} ${word}`;
  if (element.dataset['key'] === key) return;
  element.dataset['key'] = key;
  element.className = kind === 'plain' ? 'tag' : `tag ${kind}`;
  element.replaceChildren(...(kind === 'plain' ? [icon('ok', 's')] : kind === 'warn' ? [icon('warn', 's')] : []), word);
}

/** @returns {string[]} */
function addresses() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? '[]');
    return Array.isArray(kept) ? kept.filter((one) => typeof one === 'string') : [];
  } catch {
    return [];
  }
}

/** @param {string[]} all */
function keep(all) {
  try {
    localStorage.setItem(KEY, JSON.stringify(all));
  } catch {
    // no storage: forgotten
  }
}
