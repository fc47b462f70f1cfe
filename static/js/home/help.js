// The text on Home while no signal of the car has arrived: what is missing, and how to supply it.

import { field, setSentence, show } from '../core/dom.js';
import { counted } from '../core/format.js';

/**
 * @param {Pick<import('../core/protocol-types.js').State, 'signals' | 'link' | 'session'>} frame
 * @returns {string} empty: values have arrived, or the chain shows why none do
 */
export function helpWords({ signals, link, session }) {
  const all = Object.values(signals);
  if (session.phase !== 'monitoring' || link.cut !== null || all.some(({ freshness }) => freshness !== 'never' && freshness !== 'not_published')) return '';
  if (all.some(({ freshness }) => freshness === 'never')) return `No message yet. Home fills with the first messages of the ${counted(link.topics_subscribed, 'topic')} that were subscribed to.`;
  return 'None of this car’s topics is recognised. Open Settings and choose a topic for speed, position and scan: Home, Map and Scan fill from them.';
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const text = field(root, 'help-text');
  function draw() {
    const sentence = store.frame && !store.frame.replay ? helpWords(store.frame) : '';
    setSentence(text, sentence);
    show(root, sentence !== '');
  }
  draw();
  return store.on('draw', draw);
}
