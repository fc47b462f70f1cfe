// The slow-down on the page: its slides, the key that releases the car, the proof step by step, and the count-down of one that
// comes by itself. What each says: slow-layout.js.

import { field, html, icon, listen, need, setAttribute, setIcon, setText, setWords, show } from '../core/dom.js';
import { mountSlide } from './slide.js';
import { countdownOf, guardWords, holdOf, orderOf, orderWords, releaseOf, slideOf, stateWord, stepsOf } from './slow-layout.js';

/** Without an answer by then nobody knows whether the car is slowed; the frames will say [ms]. */
const ANSWER_MS = 2000;
/** A count-down comes up under a finger that meant something else: a press so soon is none [ms]. */
const MEANT_MS = 300;
const MARKS = { ok: 'ok', wait: 'unknown', crit: 'crit' };

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../control/control.js').Control} Control
 * @typedef {import('../control/control.js').Say} Say
 * @typedef {import('./slow-layout.js').Seen} Seen
 */

/**
 * What decides how the slow-down looks on this page now.
 * @param {Store} store
 * @returns {Seen}
 */
export function seenOf(store) {
  const { frame, control } = store;
  return {
    now: frame?.decelerate ?? null, isSilent: store.isSilent, isViewer: store.isViewer, isReplay: frame?.replay !== undefined,
    mayControl: store.fence !== null || !control?.holder, holder: control?.holder ?? null,
  };
}

/**
 * @param {HTMLElement} root the monitor's board
 * @param {Store} store
 * @param {Control} control
 * @param {Say} say
 */
export function mount(root, store, control, say) {
  const releaseSheet = /** @type {HTMLDialogElement} */ (need(document, '#sheet-release'));
  const [release, releaseWords] = [field(root, 'release'), field(root, 'release-words')];
  const [steps, line, said] = [field(root, 'order-steps'), field(root, 'order-line'), field(root, 'order-said')];
  const rows = stepRows(need(steps, 'ol'));
  const home = need(root, '[data-part="slow"]');
  const legends = [...document.querySelectorAll('[data-f="legend-car"]')];
  const leftLegend = field(root, 'legend-left');
  /** Until when an order of this page is under way [ms]. */
  let sending_ms = -Infinity;
  let told = '';

  const slides = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll('.slide[data-f="slow"]'))].map((slide) => {
    const sheet = slide.closest('dialog');
    const says = sheet && field(sheet, 'slow-says');
    /** Where it is read: a notice lies beneath an alarm's sheet. @param {string} sentence @param {string} title */
    const tell = (sentence, title) => {
      if (!says || !sheet?.open) return say(sentence, title);
      show(says, true);
      setWords(says, `${title}: ${sentence}`);
    };
    if (says) sheet.addEventListener('close', () => show(says, false));
    return mountSlide(slide, {
      press: () => (sheet ? tell(whyOff(), 'Not slowed') : openSheet()),
      order: (at_ms) => void order(at_ms, tell),
    });
  });

  /** Said in an alarm's sheet, where nothing is armed. */
  function whyOff() {
    const seen = seenOf(store);
    const { state, why } = seen.now ?? {};
    const because = seen.isSilent ? 'the server does not answer.'
      : seen.isViewer ? 'viewers cannot use it.'
        : state === 'safe' ? 'the slow-down is not armed; acknowledge the alarm, then arm it on Home.'
          : why ?? 'it is not available.';
    return `${because} Use the physical stop.`;
  }

  /** @param {number} at_ms when the slide was let go @param {(sentence: string, title: string) => void} tell */
  async function order(at_ms, tell) {
    const { frame } = store;
    if (!frame) return;
    const ago_s = (performance.now() - at_ms) / 1000;
    sending_ms = store.now() + ANSWER_MS;
    const asked = store.ask('slow_down', {
      pressed_ago_s: ago_s >= 0 && ago_s < 60 ? ago_s : 0, // an old browser counts its events from another moment
      heard_ms: frame.server.time_ms, held_s: (store.now() - store.deadMan.heard_ms) / 1000,
    }, ANSWER_MS);
    draw();
    const answer = await asked;
    if (!answer.ok) {
      sending_ms = -Infinity;
      tell(`${answer.reason ?? 'Refused.'} Use the physical stop.`, 'NOT slowed');
    }
    draw();
  }

  function openSheet() {
    import('./slow-sheet.js').then(({ openSlow }) => openSlow(store, control)).catch(() => say('What shows the slow-down could not be fetched.', 'Not opened'));
  }

  async function letGo() {
    const number = Number(releaseSheet.dataset['order']);
    releaseSheet.close();
    const answer = await store.ask('release', { number });
    if (!answer.ok) say(answer.reason ?? 'Refused.', 'Not released');
  }

  function askRelease() {
    const seen = seenOf(store);
    const hold = holdOf(seen.now);
    const may = releaseOf(seen);
    if (!hold) return;
    if (!may.can) return say(may.why, 'Not released', seen.isViewer ? undefined : { label: 'Ask for control', act: () => void control.order('request') });
    releaseSheet.dataset['order'] = String(hold.number);
    const standing = store.frame?.alarms.filter((alarm) => alarm.priority === 'critical' && alarm.active) ?? [];
    setWords(field(releaseSheet, 'alarms'), standing.length ? `Still standing: ${standing.map(({ title }) => title).join(', ')}.` : '');
    if (!releaseSheet.open) releaseSheet.showModal();
  }

  function draw() {
    const seen = seenOf(store);
    const { now } = seen;
    const order = orderOf(now);
    const isSending = store.now() < sending_ms && !order;
    const view = isSending ? { kind: /** @type {const} */ ('go'), title: 'Sending', why: 'the order', label: 'The order to slow down is being sent' } : slideOf(seen);
    for (const slide of slides) slide.draw(view);
    const word = stateWord(seen);
    for (const legend of legends) {
      setText(legend, `slow-down: ${word.toLowerCase()}`);
      setAttribute(legend, 'data-state', word.toLowerCase());
    }
    const hold = seen.isReplay ? null : holdOf(now);
    setText(leftLegend, hold ? 'slow-down' : 'monitoring');
    show(field(root, 'stop'), !hold);
    show(field(root, 'pause'), !hold || store.frame?.session.paused === true); // to resume is never taken away
    const may = releaseOf(seen);
    show(release, hold !== null);
    setText(releaseWords, may.label);
    setAttribute(release, 'data-barred', !may.can || null);
    if (releaseSheet.open && (!hold || String(hold.number) !== releaseSheet.dataset['order'] || !may.can)) releaseSheet.close();
    drawSteps(order);
    const guard = guardWords(now?.guard, store.lag_s);
    setText(field(home, 'slow-state'), `Slow-down: ${word.toLowerCase()}`);
    setWords(field(home, 'slow-guard'), now?.state === 'not_available' && now.why && !seen.isSilent ? `${now.why} ${guard.text}.` : `${guard.text}.`);
    setAttribute(home, 'data-state', word.toLowerCase());
    show(home, !seen.isReplay); // of a recording it would say what holds of no car
  }

  /** @param {import('../core/protocol.js').SlowOrder | null} order */
  function drawSteps(order) {
    show(steps, order !== null);
    tell(order);
    if (!order) return;
    stepsOf(order).forEach(({ label, value, mark }, i) => {
      const row = rows[i];
      if (!row) return;
      setAttribute(row.item, 'data-mark', mark);
      setIcon(row.mark, MARKS[mark]);
      setText(row.label, label);
      setWords(row.value, value);
    });
    const words = orderWords(order, store.isSilent ? 0 : store.lag_s);
    setAttribute(steps, 'data-kind', words.kind || null);
    setWords(line, words.text);
  }

  /** Said aloud by a screen reader, once each. @param {import('../core/protocol.js').SlowOrder | null} order */
  function tell(order) {
    const words = !order ? (told ? 'The car is released.' : '')
      : order.stands ? orderWords(order, 0).text : order.confirmed === null ? 'Slow-down ordered.' : order.confirmed ? 'The car slows: confirmed.' : orderWords(order, 0).text;
    if (!order && told === 'The car is released.') return;
    if (words === told) return;
    setText(said, words);
    told = words;
  }

  draw();
  const stops = [
    store.on('draw', draw),
    listen(release, 'click', askRelease),
    listen(field(releaseSheet, 'yes'), 'click', () => void letGo()),
    listen(field(releaseSheet, 'no'), 'click', () => releaseSheet.close()),
    listen(home, 'click', openSheet),
    ...slides.map((slide) => slide.stop),
    mountCountdown(store),
  ];
  return () => stops.forEach((stop) => stop());
}

/** Four places, filled by drawSteps. @param {Element} list */
function stepRows(list) {
  return Array.from({ length: 4 }, () => {
    const [mark, label, value] = [icon('unknown', 's'), html('span', { class: 'lab' }), html('b')];
    const item = html('li', {}, mark, label, value);
    list.append(item);
    return { item, mark, label, value };
  });
}

/** The banner of a slow-down that comes by itself, over everything, with a key that keeps it away. @param {Store} store */
function mountCountdown(store) {
  const banner = /** @type {HTMLDialogElement} */ (need(document, '#sheet-countdown'));
  const at = (/** @type {string} */ name) => field(banner, name);
  const [veto, bar, says] = [at('veto'), at('bar'), at('says')];
  let from_s = 0;
  let shown_ms = -Infinity;
  /** What was vetoed here: the frames say so a moment later. */
  let vetoed = '';

  function draw() {
    const now = store.frame?.replay ? store.frame.live?.decelerate : store.frame?.decelerate;
    const coming = store.isSilent ? null : countdownOf(now, store.lag_s);
    if (!coming) {
      vetoed = '';
      if (banner.open) banner.close();
      return;
    }
    if (vetoed === coming.trigger) return;
    if (!banner.open) {
      from_s = coming.left_s;
      shown_ms = performance.now();
      setText(says, '');
    }
    setWords(at('title'), coming.title);
    setWords(at('text'), coming.text);
    setText(at('left'), coming.left_s.toFixed(1));
    bar.style.transform = `scaleX(${Math.min(1, coming.left_s / Math.max(0.1, from_s)).toFixed(3)})`;
    veto.dataset['trigger'] = coming.trigger;
    show(veto, !store.isViewer);
    show(at('viewer'), store.isViewer);
    lift();
  }

  /** On top of whatever else opened meanwhile, an alarm's sheet too. */
  function lift() {
    const others = document.querySelectorAll('dialog[open]:not(#sheet-countdown)');
    const key = [...others].map(({ id }) => id).join();
    if (banner.open && banner.dataset['over'] === key) return;
    banner.dataset['over'] = key;
    if (banner.open) banner.close();
    banner.showModal();
  }

  async function refuse() {
    if (performance.now() - shown_ms < MEANT_MS) return;
    const trigger = veto.dataset['trigger'] ?? '';
    const answer = await store.ask('veto', { trigger }, ANSWER_MS);
    if (answer.ok) {
      vetoed = trigger;
      banner.close();
    } else setWords(says, `Not vetoed: ${answer.reason ?? 'refused.'}`);
  }

  if (store.frame) draw();
  const stops = [
    store.on('draw', draw),
    listen(veto, 'click', () => void refuse()),
    listen(banner, 'cancel', (event) => event.preventDefault()), // leaving it is no veto
  ];
  return () => stops.forEach((stop) => stop());
}
