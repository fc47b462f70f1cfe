// Saved data while no car is monitored: the list of the Files tab on a board of its own, over the connect screen.

import { mount } from './files.js';
import { html, icon, listen, need, setAttribute } from '../core/dom.js';

/**
 * @param {import('../core/store.js').Store} store
 * @param {(sentence: string, title?: string, way?: import('../shell/notice.js').Way) => void} say
 * @param {import('../shell/router.js').Router} router
 */
export function openSaved(store, say, router) {
  if (document.querySelector('.saved-board')) return;
  const beneath = need(document, '#connect');
  const back = html('button', { type: 'button', class: 'btn', 'aria-label': 'Back', 'data-f': 'saved-back' }, icon('back'));
  const title = html('h2', { tabindex: -1 }, 'Saved data');
  const panel = html('section', { class: 'panel', 'aria-label': 'Recordings', tabindex: 0 });
  const board = html('div', { class: 'board saved-board', role: 'region', 'aria-label': 'Saved data' }, html('div', { class: 'titlebar' }, back, title), html('div', { class: 'view' }, panel));
  setAttribute(beneath, 'inert', true);
  document.body.append(board);
  const files = mount(panel, { store, say, isFront: () => true });
  const opened = Date.now(); // an older entry is of a board that was closed in another way
  history.pushState({ saved: opened }, '');
  title.focus();

  function close() {
    stops.forEach((stop) => stop());
    files.stop();
    board.remove();
    setAttribute(beneath, 'inert', null);
    if (!beneath.hidden) need(beneath, '[data-f="saved"]').focus();
  }
  const stops = [
    listen(back, 'click', () => history.back()),
    listen(window, 'popstate', () => board.inert || history.state?.saved === opened || close()), // the phone's back key too; what lay over the board had an entry beyond that of the board
    store.on('draw', () => {
      if (router.isMonitorShown) close(); // a car is monitored, or a recording is shown
    }),
  ];
}
