// Before the first frame: that the server is being reached, or that it does not answer.

import { drawBigChain } from '../shell/chain.js';
import { field, setText, setSentence } from '../core/dom.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const [title, chain, text] = [field(root, 'title'), field(root, 'chain'), field(root, 'words')];

  function draw() {
    if (root.hidden) return;
    const { chain: view, isSilent } = store;
    drawBigChain(chain, isSilent ? view : { ...view, nodes: view.nodes.map((node, i) => (i === 1 ? { ...node, mark: 'connecting', isBad: false } : node)) });
    const isCarLost = isSilent && view.isUnserved;
    setText(title, isCarLost ? 'The car cannot be reached' : isSilent ? 'The server does not answer' : 'Reaching the server');
    setSentence(text, isCarLost ? `${view.sentence} No value and no alarm of it can be shown. This page keeps trying.` : isSilent ? 'No value and no alarm can be shown. This page keeps trying.' : '');
  }

  draw();
  return store.on('draw', draw);
}
