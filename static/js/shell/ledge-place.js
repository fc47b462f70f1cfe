// The place above the rail where the Mark key comes: kept free from the first picture on, so that nothing moves under a finger.

import { listen, need, setAttribute, show } from '../core/dom.js';

/** Tabs that show the car. */
const LIVE = ['home', 'map', 'scan'];
/** A lower phone has not room for everything. */
const LOW = 'height < 43.75em';
/** On a lower one the list of alarms, or a check, needs the room; an open sheet does on any phone. */
const SHORT = 'height < 50em';
/** On a phone on its side, or over its keyboard, a notice needs it. */
const LEAST = 'height < 32.5em';
const WIDE = 'width >= 62.5em';
const NARROW = 'width < 43.75em';
/** There a drawer stands beside the instruments. */
const DESK = '(width >= 75em) and (height >= 37.5em)';

/** Measured in this way it costs no layout of the page, which innerWidth and innerHeight do. @param {string} size */
const is = (size) => matchMedia(`(${size})`).matches;

/** On a low phone the steps of a slow-down and a warning leave no room: they come first; on its side a warning alone does, or a slow-down that is not confirmed. @param {HTMLElement} monitor @param {import('../core/store.js').Store} store */
function isCramped(monitor, store) {
  if (monitor.querySelector(':scope > .ledge :is([data-held], .fresh:not([hidden]))')) return false; // what a person is at stays
  if (monitor.dataset['over'] === 'headed' && is(is(NARROW) ? SHORT : LEAST)) return true;
  if (monitor.dataset['sheet'] !== undefined && is(NARROW)) return true;
  const isLeast = is(LEAST) && !is(WIDE);
  const { state, order } = store.frame?.decelerate ?? {};
  const isSlowing = state === 'ordered' || state === 'holding';
  if (isSlowing && order?.confirmed === false && isLeast) return true; // the distance to what is ahead needs the room
  if (!document.body.hasAttribute('data-snack')) return false;
  return isLeast || (isSlowing && is(NARROW) && is(LOW));
}

/** What is marked is the live drive: in a replay there is no such place. @param {HTMLElement} monitor @param {import('../core/store.js').Store} store */
function placeLedge(monitor, store) {
  const root = document.documentElement;
  const isLive = LIVE.includes(monitor.dataset['front'] ?? '') || (monitor.dataset['wide'] === 'drawer' && matchMedia(DESK).matches);
  const isThere = isLive && !store.replaying && !root.hasAttribute('data-replay') && !isCramped(monitor, store);
  show(need(monitor, ':scope > .ledge'), isThere);
  setAttribute(root, 'data-ledge', isThere);
}

/**
 * A warning that comes, or a list that opens, finds its room in the same picture, not with the next state of the car.
 * @param {HTMLElement} monitor
 * @param {import('../core/store.js').Store} store
 */
export function mount(monitor, store) {
  const place = () => placeLedge(monitor, store);
  const seen = new MutationObserver(place);
  seen.observe(document.body, { attributeFilter: ['data-snack'] });
  seen.observe(monitor, { attributeFilter: ['data-over', 'data-front', 'data-sheet'] });
  const stops = [store.on('draw', place), listen(window, 'resize', place), () => seen.disconnect()];
  if (store.frame) place(); // before the first frame it is not shown
  return () => stops.forEach((stop) => stop());
}
