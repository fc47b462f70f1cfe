// The line on Home with the number of operators who would hear an alarm; behind it, what this phone can do.

import { reachOf } from './control-layout.js';
import { field, listen, setAttribute, setIcon, need, setSentence } from '../core/dom.js';

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 * @param {() => void} openPhone
 */
export function mount(root, store, openPhone) {
  const [text, why, mark] = [field(root, 'reach-text'), field(root, 'reach-why'), need(root, '.i')];

  function draw() {
    const { frame } = store;
    const seen = reachOf(store.isSilent ? null : frame?.replay ? frame.live?.reach : frame?.reach);
    setSentence(text, (frame?.replay ? 'Live: ' : '') + seen.text);
    setSentence(why, seen.why);
    setIcon(mark, seen.isBad ? 'bell-off' : 'bell');
    setAttribute(root, 'data-bad', seen.isBad || null);
  }

  draw();
  const stops = [store.on('draw', draw), listen(root, 'click', openPhone)];
  return () => stops.forEach((stop) => stop());
}
