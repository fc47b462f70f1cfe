// What a page shows and sounds that cannot draw. Its text is in the page from the beginning, and a CSS animation uncovers them
// 2 s after the last completed drawing (frame.css), whatever becomes of the scripts. This script is sooner and names the alarms.
// It uses as little of the browser as it can, and of everything several kinds: each line must be expected to throw.

/** @typedef {import('../core/protocol-types.js').State} State */

const UNNAMED = 'Alarms may be missing here.';
const MOST_NAMED = 3;

export class Undrawn {
  #isShown = false;
  #text = '';
  /** @type {any} the place of the alarms' names */
  #place = null;
  /** @type {any} */
  #key = null;
  #title = '';

  /**
   * @param {() => State | null} frameOf
   * @param {() => void} sound sounds the most urgent alarm
   */
  constructor(frameOf, sound) {
    this.frameOf = frameOf;
    this.sound = sound;
    this.root = /** @type {any} */ (document.documentElement);
    const named = /** @type {any} */ (globalThis); // an element with an id is a property of its window, which needs no function
    any([() => { this.#place = document.getElementById('undrawn-alarms'); }, () => { this.#place = named['undrawn-alarms']; }]);
    any([() => { this.#key = document.getElementById('undrawn-reload'); }, () => { this.#key = named['undrawn-reload']; }]);
  }

  /** Drawing has failed, or fails still. */
  show() {
    if (!this.#isShown) {
      this.#isShown = true;
      attempt(() => { this.#title = document.title; });
      any([
        () => proven(() => { this.root.dataset.undrawn = ''; }, () => this.root.dataset.undrawn === ''),
        () => proven(() => this.root.setAttribute('data-undrawn', ''), () => this.root.getAttribute('data-undrawn') === ''),
        () => { this.root.className = 'undrawn-now'; },
        () => { this.root.id = 'undrawn-now'; },
      ]);
      attempt(() => { this.#key.tabIndex = 0; });
      attempt(closeSheets); // while one is open, nothing beside it can be pressed
    }
    attempt(() => this.#name());
    attempt(() => { if (isWatched(this.frameOf())) this.sound(); });
  }

  /** Everything is drawn again. */
  hide() {
    if (!this.#isShown) return;
    this.#isShown = false;
    this.#text = '';
    attempt(() => { delete this.root.dataset.undrawn; });
    attempt(() => { this.root.removeAttribute('data-undrawn'); });
    attempt(() => { if (this.root.className === 'undrawn-now') this.root.className = ''; });
    attempt(() => { if (this.root.id === 'undrawn-now') this.root.id = ''; });
    attempt(() => { this.#key.tabIndex = -1; });
    attempt(() => { if (this.#title) document.title = this.#title; });
  }

  #name() {
    const text = namesOf(this.frameOf());
    if (text === this.#text) return;
    this.#text = text;
    const place = this.#place;
    any([
      () => proven(() => { place.firstChild.data = text; }, () => place.firstChild.data === text),
      () => { place.firstChild.nodeValue = text; },
      () => { place.textContent = text; },
      () => { place.innerText = text; },
    ]);
    attempt(() => { document.title = `${text} · catgraph`; });
  }
}

function closeSheets() {
  const sheets = document.getElementsByTagName('dialog');
  for (let i = 0; i < sheets.length; i += 1) {
    const sheet = /** @type {HTMLDialogElement} */ (sheets[i]);
    if (sheet.open) any([() => sheet.close(), () => sheet.remove()]);
  }
}

/**
 * The alarms as text, with nothing but loops: those that stand, then those that have returned, which are called so.
 * @param {State | null} frame
 */
export function namesOf(frame) {
  const alarms = (frame?.replay ? frame.live?.alarms : frame?.alarms) ?? [];
  let text = '';
  let named = 0;
  let more = 0;
  for (let i = 0; i < 2 * alarms.length; i += 1) {
    const alarm = alarms[i % alarms.length];
    const hasReturned = i >= alarms.length;
    if (!alarm || alarm.state === 'SHELVED' || alarm.priority === 'advisory' || (alarm.state === 'RTN_UNACKED') !== hasReturned) continue;
    if (named === MOST_NAMED) more += 1;
    else {
      text += (named ? ', ' : 'Alarm: ') + alarm.title + (hasReturned ? ' (returned)' : '');
      named += 1;
    }
  }
  if (more) text += ` and ${more} more`;
  return text || UNNAMED;
}

/** Is a car monitored, whose alarms would be missed? @param {State | null} frame */
function isWatched(frame) {
  const session = frame?.replay ? frame.live : frame?.session;
  return Boolean(session && !session.paused && (session.phase === 'monitoring' || session.phase === 'lost'));
}

/** Whether it did not throw. @param {() => void} act */
function attempt(act) {
  try {
    act();
    return true;
  } catch {
    return false;
  }
}

/** The first of these that does not throw. @param {(() => void)[]} acts */
function any(acts) {
  for (let i = 0; i < acts.length; i += 1) if (attempt(/** @type {() => void} */ (acts[i]))) return;
}

/** Throws where it had no effect. @param {() => void} act @param {() => boolean} isDone */
function proven(act, isDone) {
  act();
  if (!isDone()) throw new Error('no effect');
}
