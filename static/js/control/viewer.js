// What a viewer sees: every key that would change something is greyed, and a press on it shows why. The server refuses the
// same by itself; here the reason is visible before a press.

import { styled } from '../core/style-sheet.js';
import { need } from '../core/dom.js';
import { isAsked } from '../shell/sheet.js';

export const WHY = 'This device is paired as a viewer. An operator can change that: Settings, Paired devices.';

/** The keys of an operator. The server refuses a key that is missing here, with the same text. */
const KEYS = [
  '#monitor :is([data-f="stop"], [data-f="pause"], [data-f="slow"])', '.sheet [data-f="slow"]', '#sheet-menu [data-f="record"]', '[data-f="files-record"]',
  '#connect [data-f="go"]', '#sheet-stop [data-f="yes"]', '.sheet:is(#sheet-lost, #sheet-mute, #sheet-failed) [data-f="retry"]',
  '.snack:not(.note) .ac .key', '#sheet-shelve [data-minutes]', '#sheet-topic [data-f="list"] button', '#sheet-profile [data-f="list"] button', '#sheet-reset [data-f="yes"]',
  '#panel-settings .set :is(button, input)', '#panel-settings .undo', '#panel-settings .topic', '#panel-settings [data-part="import"]', '#panel-settings [data-part="reset"]',
  '#sheet-control :is([data-f="keys"], .people) button', '#sheet-phones .phones button', '[data-operator]', '[data-f="files-empty"]', '.outbox [data-do]',
].join();

/**
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string) => void} say
 */
export function mountViewer(store, say) {
  styled('access');
  const acknowledge = need(document, '#sheet-alarm [data-f="acknowledge"]');
  const label = acknowledge.lastChild;
  const usual = label?.textContent ?? '';

  /** @param {Event} event */
  const hold = (event) => {
    if (!store.isViewer || !(event.target instanceof Element) || !event.target.closest(KEYS)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.type !== 'click' && event.type !== 'submit') return;
    const sheet = event.target.closest('dialog');
    if (sheet && isAsked(sheet)) sheet.close(); // the message is shown beneath it
    say(WHY, 'A viewer can only watch');
  };
  for (const type of ['click', 'pointerdown', 'input', 'change', 'submit']) document.addEventListener(type, hold, { capture: true });

  function draw() {
    const { isViewer } = store;
    document.documentElement.toggleAttribute('data-viewer', isViewer);
    // The alarm's own key closes it on this phone: it stays unacknowledged for who may acknowledge it.
    if (label) label.textContent = isViewer ? 'Close here' : usual;
    for (const key of document.querySelectorAll(KEYS)) {
      if (isViewer) key.setAttribute('aria-disabled', 'true');
      else if (key.getAttribute('aria-disabled') === 'true') key.removeAttribute('aria-disabled');
    }
  }
  draw();
  store.on('draw', draw);
}
