import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setSentence, setText } from '../../static/js/core/dom.js';

/** As much of an element as texts need. */
class Box {
  nodeType = 1;
  className = '';
  /** @type {any[]} */
  childNodes = [];

  get firstChild() {
    return this.childNodes[0] ?? null;
  }

  get lastChild() {
    return this.childNodes.at(-1) ?? null;
  }

  /** @returns {string} */
  get textContent() {
    return this.childNodes.map((one) => one.data ?? one.textContent).join('');
  }

  set textContent(text) {
    this.replaceChildren(...(text ? [text] : []));
  }

  /** @param {...any} children */
  replaceChildren(...children) {
    this.childNodes = children.map((one) => (typeof one === 'string' ? { nodeType: 3, data: one } : one));
  }

  /** @param {...any} children */
  append(...children) {
    this.replaceChildren(...this.childNodes, ...children);
  }

  getAttribute() {
    return this.className;
  }

  /** @param {string} _ @param {string} value */
  setAttribute(_, value) {
    this.className = value;
  }
}

/** @type {any} */ (globalThis).document = { createElement: () => new Box() };

/** @returns {any} */
const box = () => new Box();

/** The texts within, in their order. @param {any} node @returns {any[]} */
const textsOf = (node) => (node.nodeType === 3 ? [node] : node.childNodes.flatMap(textsOf));

/** What it is made of. @param {any} node @returns {any} */
const shapeOf = (node) => node.data ?? [node.className, ...node.childNodes.map(shapeOf)];

test('a text goes into the text that is there', () => {
  const element = box();
  setText(element, '0.1 s');
  const [before] = element.childNodes;
  setText(element, '0.2 s');
  assert.equal(element.textContent, '0.2 s');
  assert.equal(element.childNodes[0], before);
  setText(element, '');
  assert.deepEqual(element.childNodes, []);
});

test('the numbers and units of a sentence go into those of the one before', () => {
  const element = box();
  setSentence(element, 'stops in 7.1 m of 12');
  const before = textsOf(element);
  assert.equal(before.length, 5);
  setSentence(element, 'halts in 6.9 km of 11');
  assert.equal(element.textContent, 'halts in 6.9 km of 11');
  assert.deepEqual(textsOf(element).map((one, i) => one === before[i]), [true, true, true, true, true]);
});

test('a sentence of other parts is built anew', () => {
  const element = box();
  for (const sentence of ['above 12', 'above', 'above 12', '12 m', '12', 'none', '12 m above 3', '3 above 12 m', '3 above 12', 'all', '12']) {
    setSentence(element, sentence);
    const anew = box();
    setSentence(anew, sentence);
    assert.deepEqual(shapeOf(element), shapeOf(anew));
  }
  setText(element, '12 m');
  assert.equal(textsOf(element).length, 1);
});

test('what failed halfway is written as a whole, also where it is what stood there before', () => {
  const element = box();
  setSentence(element, 'in 1 of 2');
  const second = element.childNodes[3].firstChild;
  let isBroken = true;
  Object.defineProperty(second, 'data', { get: () => '2', set: () => { if (isBroken) throw new Error('broken'); } });
  assert.throws(() => setSentence(element, 'at 3 of 4'));
  isBroken = false;
  setSentence(element, 'in 1 of 2');
  assert.equal(element.textContent, 'in 1 of 2');
});
