// A page that could not begin in whole shows nothing of the car: half of it would look as if somebody watched.

import { field, need, setAttribute, setText, setSentence, show } from '../core/dom.js';

/** Shows that this page does not work in place of the screen that the server is being reached. */
export function giveUp() {
  const start = need(document, '#start');
  for (const dialog of document.querySelectorAll('dialog')) dialog.remove(); // closed, it would take that for an answer
  field(document, 'snacks').replaceChildren();
  setAttribute(need(document, '.frame'), 'data-mode', 'none');
  for (const screen of document.querySelectorAll('main')) show(screen, screen === start);
  setAttribute(document.body, 'data-screen', 'start');
  show(field(start, 'chain'), false); // nobody knows how the link stands
  setText(field(start, 'title'), 'This page does not work');
  setSentence(field(start, 'words'), 'It could not start completely, so no value and no alarm is shown. Reload it. If that does not help, use another browser.');
}
