// When the page draws: what moves ten times a second, the rest five times, what needs the operator at once. And whether it could.

import { Drawing } from './drawing.js';

/** Digits change at most five times a second. */
export const DRAW_EVERY_MS = 200;
/** A new aim of what moves, sooner than from one frame to the next, would only cost; the move takes a little longer (instruments.css): each that ends before the next aim costs a picture too [ms]. */
const MOVE_EVERY_MS = 95;
/** What is drawn in turn takes no longer of one picture, but for the last of it: each picture has its own costs of style, layout and layers [ms]. */
const TURNS_MS = 4;
/** Where pictures come so seldom that turns wait for longer, the next one has them all: an old value would stand at full opacity beside one that is marked stale [ms]. */
const WAITS_MS = 200;
/** A page that has just begun draws without a frame only after so long: that would take the time of the first values, which mostly come before [ms]. */
const AWAITS_MS = 400;
/** While frames come so close after each other they set the pace of drawing, after that a timer does [ms]. */
const FED_MS = 300;

export class Painter {
  drawing = new Drawing();
  /** What tells the operator that this page does not draw. @type {{show(): void, hide(): void} | null} */
  undrawn = null;
  /** Something failed since the last drawing. */
  #hasFailed = false;
  #complained = '';
  #drew_ms = performance.now() + AWAITS_MS - DRAW_EVERY_MS;
  #moved_ms = -Infinity;
  #isMoved = false;
  #urgent = '';
  #isUrgent = false;
  /** What waits for one of the next pictures. @type {Set<() => void>} */
  #turns = new Set();
  #isTurning = false; // a picture for them is requested
  #waits_ms = 0; // since when some of them have waited
  #emitter;

  /** @param {import('./emitter.js').Emitter<import('./store.js').Topic>} emitter gets `move`, `draw` and `drawn` */
  constructor(emitter) {
    this.#emitter = emitter;
  }

  /** Draw with the next picture; what it throws is a failure of drawing. @param {() => void} draw */
  picture(draw) {
    requestAnimationFrame(() => this.#emitter.guard(draw));
  }

  /** Draw with one of the next pictures, after those that wait: all together they may take longer than one picture. @param {() => void} draw */
  inTurn(draw) {
    this.#turns.add(draw);
    if (this.#isTurning) return;
    this.#waits_ms = performance.now();
    this.#turn();
  }

  #turn() {
    this.#isTurning = true;
    this.picture(() => {
      const begins_ms = performance.now();
      let late = begins_ms - this.#waits_ms > WAITS_MS ? this.#turns.size : 0;
      if (late) this.#waits_ms = begins_ms;
      try {
        for (const draw of this.#turns) {
          this.#turns.delete(draw);
          draw();
          late -= 1;
          if (late <= 0 && performance.now() >= begins_ms + TURNS_MS) break;
        }
      } finally {
        this.#isTurning = this.#turns.size > 0;
        if (this.#isTurning) this.#turn();
      }
    });
  }

  /**
   * A fresh frame came: what needs the operator is drawn at once; pointers ten times a second, the rest five times and with them.
   * @param {import('./protocol-types.js').State} frame
   * @param {number} now_ms when it came
   * @param {boolean} isFirst nothing moves yet that a picture could fall between
   */
  frame(frame, now_ms, isFirst) {
    const urgent = urgentOf(frame);
    const isUrgent = urgent !== this.#urgent;
    this.#urgent = urgent;
    if (isUrgent) this.#isUrgent = true;
    if (this.#isMoved || (!isUrgent && now_ms - this.#moved_ms < MOVE_EVERY_MS)) return;
    this.#isMoved = true;
    this.#moved_ms = now_ms;
    const show = () => {
      this.#isMoved = false;
      this.#emitter.emit('move');
      if (this.#isUrgent || now_ms - this.#drew_ms >= 2 * MOVE_EVERY_MS) this.draw();
      this.#isUrgent = false;
    };
    if (isFirst) show();
    else this.picture(show);
  }

  /** Called five times a second, before all else: has the page drawn lately? @param {boolean} isSeen */
  look(isSeen) {
    const wasFailed = this.drawing.isFailed;
    this.drawing.look(isSeen);
    if (!this.drawing.isFailed) return;
    if (!wasFailed) console.error('Nothing was drawn for 1 s');
    this.undrawn?.show();
    this.#isMoved = false; // a requested animation frame may never come
    this.#turns.clear();
    this.#isTurning = false;
  }

  /** Without frames a timer sets the pace. @param {number} now_ms @param {number} heard_ms when the last fresh frame came */
  keepUp(now_ms, heard_ms) {
    if (now_ms - heard_ms > FED_MS && now_ms - this.#drew_ms >= DRAW_EVERY_MS - 20) this.picture(() => this.draw());
  }

  draw() {
    this.#drew_ms = performance.now();
    this.#emitter.emit('draw');
    if (!this.#hasFailed) this.#emitter.emit('drawn');
    const isComplete = !this.#hasFailed;
    this.#hasFailed = false;
    if (!isComplete) return;
    this.drawing.completed();
    if (!this.drawing.isFailed) this.undrawn?.hide();
  }

  /** The page covers itself: what was to be drawn, handled or sounded was not. @param {unknown} error */
  failed(error) {
    this.#hasFailed = true;
    this.drawing.failed();
    this.undrawn?.show();
    const complaint = `${error}`;
    if (complaint === this.#complained) return; // the same ten times a second
    this.#complained = complaint;
    try {
      console.error(error);
    } catch {
      // even that may be what is broken
    }
  }
}

/**
 * What must not wait for the next drawing: alarms, the link, a pause.
 * @param {import('./protocol-types.js').State} frame
 */
function urgentOf(frame) {
  const { session, link, alarms, decelerate } = frame;
  const { order } = decelerate;
  const slow = [decelerate.state, order?.number, order?.sending, order?.confirmed, order?.stands, (frame.live?.decelerate ?? decelerate).countdown?.trigger].join(' ');
  return [session.phase, session.paused, link.cut, slow, ...alarms.map((alarm) => `${alarm.id} ${alarm.occurrence} ${alarm.state}`)].join('|');
}
