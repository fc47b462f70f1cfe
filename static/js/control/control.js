// Who is in control: the request that its holder must answer, what happened to control, and the way to its sheet. The chip: cars.js.

import { askedOf, noticeOf, seconds } from './control-layout.js';
import { openHandover } from './duty.js';
import { partOf } from './duty-layout.js';
import { html, icon, listen, need, setAttribute, setSentence } from '../core/dom.js';

/** A refusal is answered with a key for so long: another one with the same text is another [ms]. */
const REFUSED_MS = 3000;
/** What happened to control waits at most so long to be announced; later it is dropped [ms]. */
const NEWS_MS = 20_000;
/** An event received later than this is not announced [ms]. */
const FRESH_MS = 5000;
/** A page that wakes has more to tell at once, and the last to speak would take the place of the others [ms]. */
const SETTLES_MS = 400;

/**
 * @typedef {import('../core/store.js').Store} Store
 * @typedef {import('../shell/notice.js').Way} Way
 * @typedef {(sentence: string, title?: string, way?: Way) => void} Say
 */

export class Control {
  /** @type {{reason: string, at_ms: number} | null} */
  #refused = null;

  /** @param {Store} store @param {Say} say tells without offering a key by itself @param {() => void} openPhone */
  constructor(store, say, openPhone) {
    this.store = store;
    this.say = say;
    this.openPhone = openPhone;
  }

  /** Ask the server for something about control. @param {import('../core/protocol-types.js').TakeControlCommand['do']} act @param {{to?: string | null}} [fields] */
  async order(act, fields = {}) {
    const answer = await this.store.ask('control', { do: act, ...fields });
    if (!answer.ok) this.say(answer.reason ?? 'Refused.', 'Control not changed');
    return answer;
  }

  /** Gives control to another page: who is on duty has it read back first. @param {string} to */
  async handOver(to) {
    if (!this.store.duty?.me) return this.order('hand_over', { to });
    const answer = await this.store.ask('offer_control', { to, vehicle: this.store.vehicle });
    if (!answer.ok) this.say(answer.reason ?? 'Refused.', 'Not handed over');
    return answer;
  }

  /** Opens who is in control, how this page gets it or gives it away. */
  openSheet() {
    if (partOf(this.store.control?.handover, this.store.page)) {
      openHandover(this.store, this.say);
      return;
    }
    import('./control-sheet.js').then(({ openControl }) => openControl(this.store, this)).catch(() => this.say('The list of operators could not be loaded.', 'Not opened'));
  }

  /** Called once for every refusal, so that its notice can offer a key. @param {import('../core/store.js').Answer} answer */
  note(answer) {
    this.#refused = answer.heldBy && answer.reason ? { reason: answer.reason, at_ms: this.store.now() } : null;
  }

  /** What helps where an order was refused because another is in control. @param {string} sentence @returns {Way | undefined} */
  wayOf(sentence) {
    const refused = this.#refused;
    if (refused?.reason !== sentence || this.store.now() - refused.at_ms > REFUSED_MS) return undefined;
    return { label: 'Request control', act: () => void this.order('request') };
  }
}

/**
 * @param {HTMLElement} snacks where the request stands
 * @param {Store} store
 * @param {Control} control
 */
export function mount(snacks, store, control) {
  const text = html('span');
  const keep = html('button', { type: 'button', class: 'key' }, 'Keep');
  const give = html('button', { type: 'button', class: 'key solid' }, 'Hand over');
  const prompt = html('div', { class: 'snack prompt', role: 'alert', 'data-f': 'prompt' },
    html('div', { class: 'side' }, icon('operator')), html('div', { class: 'tx' }, html('b', {}, 'Control requested'), text), html('div', { class: 'ac' }, keep, give));
  let asking = '';
  /** @type {{notice: NonNullable<ReturnType<typeof noticeOf>>, at_ms: number} | null} */
  let news = null;

  function draw() {
    speak();
    const { control: now } = store;
    const request = store.isSilent ? null : askedOf(now, store.page);
    asking = request?.page ?? '';
    if (!request) prompt.remove();
    else if (!prompt.isConnected) snacks.prepend(prompt);
    if (request) setSentence(text, `${request.name} gets it in ${seconds(request.left_s - store.lag_s)} unless you keep it.`);
  }

  /** @param {import('../core/protocol-types.js').LogEvent[]} events */
  function announce(events) {
    const now_ms = store.frame?.server.time_ms ?? Infinity; // a page that was just loaded receives old events: the bar shows who has control now
    const notice = events.filter((event) => event.change === 'control' && now_ms - event.at_ms <= FRESH_MS).map((event) => noticeOf(event, store.page)).findLast((one) => one !== null);
    if (notice) news = { notice, at_ms: store.now() };
    speak();
  }

  /** It takes no other notice's place: that this page was blind, or why an order was refused, is shown first. */
  function speak() {
    if (!news || snacks.querySelector('.note:not([data-of="control"])')) return;
    const { notice: { title, text, offers }, at_ms } = news;
    if (store.now() - at_ms < SETTLES_MS) return;
    news = null;
    if (store.now() - at_ms > NEWS_MS) return;
    const way = offers ? { label: offers === 'take' ? 'Take control' : 'Request it', act: () => void control.order(offers) } : undefined;
    control.say(text, title, way);
    setAttribute(need(snacks, '.note'), 'data-of', 'control');
  }

  draw();
  announce(store.log.events); // what came before there was anybody to tell
  const stops = [
    store.on('draw', draw),
    store.on('log', announce),
    store.on('switch', () => {
      news = null;
      prompt.remove();
    }),
    listen(keep, 'click', () => void control.order('keep', { to: asking })),
    listen(give, 'click', () => void control.handOver(asking)),
  ];
  return () => stops.forEach((stop) => stop());
}
