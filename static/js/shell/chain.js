// Draws the chain, small in the top bar and large in sheets and on the veil.

import { svg } from '../core/dom.js';

/** @typedef {import('../core/link.js').ChainView} ChainView */

/** @type {WeakMap<Element, string>} what each picture shows now */
const drawn = new WeakMap();

/**
 * The small chain, viewBox 84×24.
 * @param {Element} root
 * @param {ChainView} view
 */
export function drawChain(root, view) {
  const key = `${view.cut} ${view.known}`;
  if (drawn.get(root) === key) return;
  const cut = view.cut ?? 3;
  const known = view.known ?? cut;
  const parts = [];
  for (let i = 0; i < known; i += 1) parts.push(svg('path', { class: 'wire', d: `M${12 + 24 * i} 12h12` }));
  if (cut < 3) parts.push(svg('path', { class: 'cut', d: `M${21 + 24 * cut} 4l-6 16` }));
  for (let i = 0; i < 4; i += 1) {
    parts.push(svg('rect', { class: i > known ? 'node q' : 'node', x: 1 + 24 * i, y: 7, width: 10, height: 10 }));
  }
  root.replaceChildren(...parts);
  drawn.set(root, key);
}

const NODE_X = [27, 128, 230, 331]; // left edges of the nodes, 22 wide

/**
 * The large chain with names and ages, viewBox −10…390 × 84.
 * @param {Element} root
 * @param {ChainView} view
 */
export function drawBigChain(root, view) {
  const key = `${view.cut}|${view.nodes.map((node) => node.mark).join('|')}`;
  if (drawn.get(root) === key) return;
  const parts = [];
  for (let i = 0; i < 3; i += 1) {
    const from = (NODE_X[i] ?? 0) + 23;
    const to = (NODE_X[i + 1] ?? 0) - 1;
    const middle = (from + to + 2) / 2;
    if (i === view.cut) {
      parts.push(svg('path', { class: 'wire', d: `M${from} 22H${middle - 15}` }));
      parts.push(svg('path', { class: 'wire q', d: `M${middle + 15} 22H${to}` }));
      parts.push(svg('path', { class: 'cut', d: `M${middle + 6} 6l-12 32` }));
    } else {
      parts.push(svg('path', { class: view.nodes[i + 1]?.isKnown ? 'wire' : 'wire q', d: `M${from} 22H${to}` }));
    }
  }
  view.nodes.forEach((node, i) => {
    const x = NODE_X[i] ?? 0;
    parts.push(svg('rect', { class: node.isKnown ? 'node' : 'node q', x, y: 11, width: 22, height: 22 }));
    parts.push(svg('text', { x: x + 11, y: 56 }, node.name));
    parts.push(svg('text', { class: node.isBad ? 'w bad' : 'w', x: x + 11, y: 75 }, node.mark));
  });
  root.setAttribute('aria-label', label(view));
  root.replaceChildren(...parts);
  drawn.set(root, key);
}

/** @param {ChainView} view */
function label(view) {
  if (view.known !== undefined) return view.sentence;
  if (view.cut === null) return 'This device, server, bridge and car answer';
  return `The link is broken between ${view.nodes[view.cut]?.name} and ${view.nodes[view.cut + 1]?.name}`;
}
