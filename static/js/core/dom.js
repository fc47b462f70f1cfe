// The few ways in which the page touches its document. Text goes in as text; nothing is written that is already there.

import { inUnits } from './units.js';
import { pieces } from './format.js';

const SVG = 'http://www.w3.org/2000/svg';

/** @typedef {Record<string, string | number | boolean | null | undefined>} Attributes */

/** @type {WeakMap<Element, string>} the text last written into an element */
const written = new WeakMap();

/**
 * The element `selector` names inside `root`; the template must hold it.
 * @param {ParentNode} root
 * @param {string} selector
 * @returns {HTMLElement}
 */
export function need(root, selector) {
  const found = root.querySelector(selector);
  if (!found) throw new Error(`The template lacks ${selector}`);
  return /** @type {HTMLElement} */ (found);
}

/**
 * The field `data-f="name"` inside `root`.
 * @param {ParentNode} root
 * @param {string} name
 */
export function field(root, name) {
  return need(root, `[data-f="${name}"]`);
}

/**
 * An HTML element.
 * @param {string} tag
 * @param {Attributes} [attributes]
 * @param {...(Node | string)} children
 * @returns {HTMLElement}
 */
export function html(tag, attributes = {}, ...children) {
  return /** @type {HTMLElement} */ (dress(document.createElement(tag), attributes, children));
}

/**
 * An SVG element.
 * @param {string} tag
 * @param {Attributes} [attributes]
 * @param {...(Node | string)} children
 * @returns {SVGElement}
 */
export function svg(tag, attributes = {}, ...children) {
  return /** @type {SVGElement} */ (dress(document.createElementNS(SVG, tag), attributes, children));
}

/**
 * An icon of templates/_icons.html.
 * @param {string} name
 * @param {string} [kind] "s" small, "fill", "dashed"
 */
export function icon(name, kind = '') {
  return svg('svg', { class: `i ${kind}`.trim(), viewBox: '0 0 24 24', 'aria-hidden': 'true' }, svg('use', { href: `#i-${name}` }));
}

/**
 * Show another icon in an icon element.
 * @param {Element} element
 * @param {string} name
 */
export function setIcon(element, name) {
  const use = need(element, 'use');
  if (use.getAttribute('href') !== `#i-${name}`) use.setAttribute('href', `#i-${name}`);
}

/**
 * Write text, if it is not there yet; into the text that is there, for a new node costs the browser a style and a box.
 * @param {Element} element
 * @param {string} text
 */
export function setText(element, text) {
  const before = written.get(element);
  if (before === text) return;
  if (!text || !before || !fill(element.childNodes, [{ text }])) element.textContent = text;
  written.set(element, text); // last: what failed is written again
}

/**
 * Write a sentence with its numbers in the font of numbers and its speeds in the unit of this phone.
 * @param {Element} element
 * @param {string} sentence
 */
export function setSentence(element, sentence) {
  const shown = inUnits(sentence);
  const before = written.get(element);
  if (before === shown) return;
  written.delete(element); // what failed halfway is written again, and as a whole
  if (!before || !fill(element.childNodes, pieces(shown))) element.replaceChildren(...textNodes(shown));
  written.set(element, shown);
}

/**
 * Write the parts of a sentence into the nodes of the one before; false where these are of other kinds, and some may be written then.
 * @param {ArrayLike<any>} nodes
 * @param {ReturnType<typeof pieces>} parts
 */
function fill(nodes, parts) {
  return nodes.length === parts.length && parts.every(({ text, unit }, i) => {
    const node = nodes[i];
    if (!unit) return put(unit === undefined ? node : node.firstChild, text);
    return put(node.firstChild?.firstChild, text) && put(node.lastChild, unit);
  });
}

/** @param {any} node @param {string} text */
function put(node, text) {
  if (node?.nodeType !== 3) return false;
  if (node.data !== text) node.data = text;
  return true;
}

/**
 * A sentence as nodes, its numbers in spans of class n and on one line with their units, its speeds in the unit of this phone.
 * @param {string} sentence
 * @returns {(HTMLElement | string)[]}
 */
export function textNodes(sentence) {
  return pieces(inUnits(sentence)).map(({ text, unit }) => {
    if (unit === undefined) return text;
    const number = html('span', { class: 'n' }, text);
    return unit ? html('span', { class: 'nu' }, number, unit) : number;
  });
}

/**
 * Set an attribute, if it is not so yet; null, undefined and false take it away. True is "true" for ARIA, to which an empty
 * value is none, and empty for all others.
 * @param {Element} element
 * @param {string} name
 * @param {string | number | boolean | null | undefined} value
 */
export function setAttribute(element, name, value) {
  if (value === null || value === undefined || value === false) {
    if (element.hasAttribute(name)) element.removeAttribute(name);
    return;
  }
  const text = value === true && !name.startsWith('aria-') ? '' : String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

/**
 * Show or hide.
 * @param {Element} element
 * @param {boolean} isShown
 */
export function show(element, isShown) {
  setAttribute(element, 'hidden', !isShown);
}

/**
 * Keep an attribute of `element` as something else is: a style rule with `:has()` would be evaluated anew for
 * every element with every frame.
 * @param {Element} element
 * @param {string} name
 * @param {() => boolean} isSo
 * @param {Node[]} seen what it depends on
 * @param {MutationObserverInit} changes of theirs
 */
export function mirror(element, name, isSo, seen, changes) {
  const look = () => setAttribute(element, name, isSo());
  const observer = new MutationObserver(look);
  for (const one of seen) observer.observe(one, changes);
  look();
}

/** Lets the browser do what waits, so that no single task keeps a finger or a picture waiting for long. @returns {Promise<void>} */
export function breath() {
  const { scheduler } = /** @type {{scheduler?: {yield?: () => Promise<void>}}} */ (globalThis);
  return scheduler?.yield?.() ?? new Promise((resolve) => { setTimeout(resolve); });
}

/**
 * Listen, and get the way to stop listening.
 * @param {EventTarget} target
 * @param {string} type
 * @param {(event: any) => void} listener
 * @param {AddEventListenerOptions} [options]
 */
export function listen(target, type, listener, options) {
  target.addEventListener(type, listener, options);
  return () => target.removeEventListener(type, listener, options);
}

/**
 * @param {Element} element
 * @param {Attributes} attributes
 * @param {(Node | string)[]} children
 */
function dress(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) setAttribute(element, name, value);
  element.append(...children);
  return element;
}
