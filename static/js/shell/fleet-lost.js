// Where nothing is known of any car: what is lost, since when, and the way to each car's own page. And the cover that comes by CSS
// 2 s after the last fresh list, whatever becomes of the scripts.

import { drawBigChain } from './chain.js';
import { addressOf } from './fleet-rows.js';
import { rewinder } from '../core/draw-proof.js';
import { field, html, setText, setSentence, show } from '../core/dom.js';
import { age, counted, timeOfDay } from '../core/format.js';

/**
 * @typedef {'server' | 'cars' | null} Lost server: it does not answer · cars: it answers, and has data of no car
 * @typedef {{lost: Lost, silence_s: number, heard_ms: number | null, cars: number, unserved: string}} LostView
 */

const NAMES = ['This device', 'Server', 'Links', 'Cars'];

/** @param {LostView} view @returns {import('../core/link.js').ChainView} */
export function lostChain({ lost, silence_s, cars }) {
  const cut = lost === 'server' ? 0 : 1;
  const silent = silence_s === Infinity ? 'no data yet' : `silent ${age(silence_s)} s`;
  const marks = lost === 'server' ? ['here', silent, 'unknown', 'unknown'] : ['here', 'answers', silent, 'unknown'];
  const nodes = NAMES.map((name, i) => ({ name: i === 3 && cars ? counted(cars, 'car') : name, mark: marks[i] ?? '', isBad: i === cut + 1, isKnown: i <= cut }));
  return { state: 'Lost', age_s: silence_s, cut, since_ms: null, nodes, sentence: '', detail: '' };
}

/** @param {LostView} view @returns {[string, string]} what is lost, and what follows */
export function lostWords({ lost, heard_ms, cars, unserved }) {
  const since = heard_ms === null ? '' : ` Last data at ${timeOfDay(heard_ms)}.`;
  const what = `Nothing here is known now. ${cars ? `Cars may still be moving, and alarms of ${counted(cars, 'car')} do not arrive here.` : ''}`.trim();
  if (lost === 'server') return [`The server stopped answering.${since} This page dials again.`, what];
  return [`${unserved || 'The server answers, but no data arrives from any car: the broker or the way to the cars is lost.'}${since}`, what];
}

export class LostPanel {
  #own = '';

  /** @param {HTMLElement} root @param {(name: string, key: HTMLElement) => void} off marks a car as off on purpose */
  constructor(root, off) {
    this.off = off;
    this.root = field(root, 'lost');
    this.title = field(root, 'lost-title');
    this.age = field(root, 'lost-age');
    this.chain = field(root, 'lost-chain');
    this.text = field(root, 'lost-words');
    this.what = field(root, 'lost-what');
    this.ownWords = field(root, 'lost-own');
    this.own = field(root, 'own');
  }

  /** @param {LostView} view @param {string[]} names @param {string[]} silent those of which a person may say that they are off */
  draw(view, names, silent) {
    show(this.root, view.lost !== null);
    if (view.lost === null) return;
    setText(this.title, view.lost === 'server' ? 'Server lost' : 'No data from any car');
    setText(this.age, view.silence_s === Infinity ? '' : `${age(view.silence_s)} s`);
    drawBigChain(this.chain, lostChain(view));
    const [text, what] = lostWords(view);
    setSentence(this.text, text);
    setSentence(this.what, what);
    show(this.ownWords, names.length > 0);
    const may = view.lost === 'cars' ? silent : [];
    const own = [...names, '', ...may].join('\n');
    if (own === this.#own) return;
    this.#own = own;
    this.own.replaceChildren(...names.map((name) => html('li', {}, html('a', { href: addressOf(name) }, name), ...(may.includes(name) ? [this.#key(name)] : []))));
  }

  /** @param {string} name */
  #key(name) {
    const key = html('button', { type: 'button', class: 'key', 'aria-label': `It is off: ${name}` }, 'It is off');
    key.addEventListener('click', () => this.off(name, key));
    return key;
  }
}

/** Turns the CSS covers back after each complete drawing. @param {import('./fleet-store.js').FleetStore} store */
export function mountCovers(store) {
  return store.on('drawn', rewinder(store, () => store.cars));
}
