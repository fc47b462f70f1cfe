// The dead-man veil: covers the values when frames stop. The covering itself is a CSS animation (sheets of
// frame.css) that every completed drawing of a fresh frame rewinds, so that it comes even when this script hangs.

import { drawBigChain } from './chain.js';
import { rewinder } from '../core/draw-proof.js';
import { field, html, mirror, need, setAttribute, setText, setSentence, show, textNodes } from '../core/dom.js';
import { speedWords } from '../core/units.js';
import { unseenOf, unseenWords } from '../core/unseen.js';
import { ageWords, fixed, timeOfDay } from '../core/format.js';

/** What is known of the recorder under the veil: what it did then, or what is safe for good. @type {Record<string, string>} */
const RECORDED = { recording: 'was on', held: 'saved', saving: 'was being saved', stopped: 'had stopped' };

/**
 * The last values; empty where there are none.
 * @param {import('../core/protocol-types.js').State | null} frame
 */
export function thenWords(frame) {
  const speed_mps = frame?.signals.speed?.value?.speed_mps;
  const distance_m = frame?.signals.distance?.value?.distance_m;
  const parts = [];
  if (typeof speed_mps === 'number') parts.push(speedWords(speed_mps).join(' '));
  if (typeof distance_m === 'number') parts.push(`object at ${fixed(distance_m)} m`);
  return parts.join(', ');
}

/**
 * Whether the veil is shown. Where the server runs, it covers the values of a car that fell silent; before the first message of a
 * car there is nothing to cover, but the empty instruments must not look like instruments.
 * @param {import('../core/store.js').Store} store
 */
export function veilOf(store) {
  if (store.isSilent || store.painter.drawing.isFailed) return 'all';
  const { frame } = store;
  if (!frame) return 'all';
  if (frame.session.phase === 'lost' || store.chain.cut !== null) return 'values';
  return null;
}

/**
 * @param {HTMLElement} root
 * @param {import('../core/store.js').Store} store
 */
export function mount(root, store) {
  const veil = field(root, 'veil');
  const [title, sentence, then, recName, rec] = ['veil-title', 'veil-words', 'veil-then', 'veil-rec-name', 'veil-rec'].map((name) => field(root, name));
  const chain = field(veil, 'chain');
  if (!title || !sentence || !then || !recName || !rec) throw new Error('The template lacks the veil');
  const sheets = ['#sheet-lost', '#sheet-mute'].map((id) => need(document, id)); // they show the same
  mirror(veil, 'data-explained', () => sheets.some((sheet) => sheet.hasAttribute('open')), sheets, { attributeFilter: ['open'] });
  let written = '';
  let isDrawn = false;
  const plate = need(veil, '.plate');

  function draw() {
    const kind = veilOf(store);
    setAttribute(veil, 'data-on', kind);
    setAttribute(need(root, '.view'), 'data-veil', kind);
    setAttribute(root, 'data-covered', kind);
    if (kind === null && plate.hidden && !isDrawn) {
      isDrawn = true; // the first values come before the texts of the veil: those are drawn with the next frame
      return;
    }
    show(plate, true);
    const view = store.chain;
    // While values arrive, the plate already holds the text for a script that hangs: then nobody knows where the chain is cut.
    const isUnsaid = kind === null || store.painter.drawing.isFailed;
    show(chain, !isUnsaid);
    drawBigChain(chain, view);
    const was = thenWords(store.frame);
    setSentence(title, isUnsaid ? 'Stale' : titleOf(view, store.frame?.link.car_age_s));
    const [bold, plain] = isUnsaid ? ['The display is not updating.', 'The page or the server has stopped. Watch the car.'] : [view.sentence, detailOf(view)];
    if (written !== `${bold}|${plain}`) {
      sentence.replaceChildren(html('b', {}, ...textNodes(bold)), ' ', ...textNodes(plain));
      written = `${bold}|${plain}`;
    }
    setSentence(then, [was, unseenWords(unseenOf(store))].join(', '));
    for (const part of [/** @type {HTMLElement} */ (then.previousElementSibling), then]) show(part, was !== '');
    const recording = RECORDED[store.frame?.recording.state ?? 'off'] ?? '';
    setText(rec, recording);
    for (const part of [recName, rec]) show(part, recording !== '');
  }

  if (store.frame) draw(); // before the first frame it is not shown
  const stops = [store.on('drawn', rewinder(store, () => store.frame)), store.on('draw', draw)];
  return () => stops.forEach((stop) => stop());
}

/** The title; what never sent a message is not called stale. @param {import('../core/link.js').ChainView} view @param {number | null} [car_s] age of the car's newest message */
export function titleOf({ state, age_s }, car_s) {
  if (state === 'Silent' && car_s === null) return 'No values yet'; // the strip says that nothing was received
  if (age_s === null) return 'Stale';
  return state === 'Waking' ? state : `Stale ${ageWords(age_s)}`;
}

/** @param {import('../core/link.js').ChainView} view */
function detailOf(view) {
  if (view.state === 'Silent' && view.since_ms !== null) {
    return `${view.detail} Last message at ${timeOfDay(view.since_ms)}.`;
  }
  return view.detail;
}
