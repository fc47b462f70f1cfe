// The beginning of the page: creates the store and the alarm sound, and mounts every part.

import './boot/trusted-types.js';
import { followLink } from './boot/follow-link.js';

import { Admission } from './pairing/admission.js';
import { soundOf } from './alarms/alarm-layout.js';
import { Arming } from './boot/arming.js';
import { deviceName, keptHere } from './control/device-name.js';
import { breath, field, listen, need, show } from './core/dom.js';
import { styled } from './core/style-sheet.js';
import { gapWords } from './core/event-log.js';
import { takeEarly } from './boot/early-socket.js';
import { forgetWork } from './boot/forget.js';
import { giveUp } from './boot/give-up.js';
import { DeviceStatus } from './phone/device-status.js';
import { holdTaps } from './boot/held-taps.js';
import { laterWords } from './core/outcome.js';
import { notices } from './shell/notice.js';
import { ownName } from './control/own-name.js';
import { Press } from './shell/press.js';
import { Router } from './shell/router.js';
import { Phone } from './phone/phone.js';
import { Presence } from './control/presence.js';
import { Screens } from './shell/screens.js';
import { floorQuery, isWall } from './shell/layout.js';
import { Cars, mountChip } from './shell/cars.js';
import { CarsAlarms } from './shell/cars-alarms.js';
import { closeSheet, mountSheets } from './shell/sheet.js';
import { Store } from './core/store.js';
import { tabContents } from './shell/tab-contents.js';
import { Tabs } from './shell/tabs.js';
import { Undrawn } from './shell/undrawn.js';
import { AlarmSound } from './alarms/alarm-sound.js';
import { lossKey, mount as mountDialogs } from './shell/dialogs.js';
import { mount as mountBadge } from './shell/badge.js';
import { mount as mountChecks } from './alarms/checks.js';
import { mount as mountConnect } from './shell/connect.js';
import { Control, mount as mountControl } from './control/control.js';
import { mount as mountDuty } from './control/duty.js';
import { mount as mountGauge } from './home/gauge.js';
import { mount as mountHelp } from './home/help.js';
import { mount as mountInstall } from './shell/install.js';
import { mount as mountNearest } from './home/nearest.js';
import { mount as mountPedals } from './home/pedals.js';
import { mount as mountPosition } from './home/position.js';
import { mount as mountPreferences } from './shell/preferences.js';
import { mount as mountActionBar } from './shell/action-bar.js';
import { mount as mountReach } from './control/alarm-reach.js';
import { mount as mountSlowing } from './slowdown/slowing.js';
import { mount as mountSnackbar } from './shell/snackbar.js';
import { mount as mountStart } from './boot/start.js';
import { mount as mountStrip } from './shell/strip.js';
import { mount as mountTopbar } from './shell/topbar.js';
import { mount as mountTrends } from './home/trends.js';
import { mount as mountVeil } from './shell/veil.js';
import { whenWanted } from './shell/when-wanted.js';

/** The rest of the page waits no longer for the first values [ms]. */
const WAITS_MS = 400;

/** Stops what has begun. */
let stop = () => {};
let isOver = false;
/** @type {Undrawn | null} */
let undrawn = null;

/** Uses nothing of the browser beyond the language itself: this is what remains when the browser fails. */
async function run() {
  try {
    await begin();
  } catch (error) {
    isOver = true;
    console.error(error);
    try {
      stop(); // a page that cannot alert anybody must not show values that look live
    } finally {
      try {
        giveUp(); // first: a dialog that is closed, not removed, would acknowledge its alarm
      } finally {
        undrawn?.show();
      }
    }
  }
}

/**
 * First what is seen at a glance, with its first values; then, part after part, what answers a finger. As one piece it would
 * delay the values on a slow phone by a third of a second, and everything else as long.
 */
async function begin() {
  const release = holdTaps();
  const page = new Page();
  await breath();
  mountGlance(page);
  await breath();
  page.store.start();
  await glanced(page.store);
  page.store.sync.greet();
  mountAlarms(page);
  await breath();
  mountControl(field(document, 'snacks'), page.store, page.control);
  await breath();
  const arming = page.mountPhone();
  await breath();
  const contents = mountScreens(page, arming);
  await breath();
  mountReach(need(page.monitor, '[data-part="reach"]'), page.store, () => page.openPhone());
  mountChecks(need(page.monitor, '[data-part="checks"]'), page.store);
  await breath();
  mountTrends(need(page.monitor, '[data-part="trends"]'), page.store, page.say);
  whenWanted(page.monitor, page.store, page.say);
  await breath();
  mountBadge(page.store);
  page.router.onShown = () => {
    page.shown();
    void unfold(page);
  };
  page.front = () => queueMicrotask(() => contents.forEach((content) => content.look()));
  listenEverywhere(page, arming);
  followLink(page.store, page.say);
  page.draw();
  page.front();
  void unfold(page);
  release();
  // What outlasts this visit, and what nobody presses at once, is loaded when the page is complete.
  const wide = new Promise((resolve) => { floorQuery().addEventListener('change', resolve, { once: true }); });
  void Promise.race([wide, new Promise((resolve) => { setTimeout(resolve, matchMedia('(width >= 43.75em)').matches ? 0 : 2000); })]).then(() => mountDesk(page)); // elsewhere there are no panes
  setTimeout(() => import('./drive/ledge.js').then(({ mount }) => mount(page.monitor, page.store, page.say)).catch(() => page.say('The Mark key could not be loaded from the server. Reload the page.', 'Not complete')), 3000);
  setTimeout(() => import('./control/duty-notices.js').then(({ mount }) => mount(page.store, page.say)).catch(() => page.say('This page shows no hand-over, end of a duty or alarms left behind: that part could not be loaded from the server. Reload the page.', 'Not complete')), 2000);
  setTimeout(() => import('./boot/service-worker.js').then(({ Shell }) => new Shell(page.store, page.say)).catch(() => {}), 2000);
  setTimeout(() => import('./shell/sheet-head.js').then(({ mount }) => mount(page.monitor, page.store)).catch(() => {}), 2000);
  setTimeout(prefetch, 10_000);
}

/** What all parts share: the store, the alarm sound, control, notices, screens and tabs. */
class Page {
  alarmSound = new AlarmSound();
  monitor = need(document, '#monitor');
  press = new Press(field(this.monitor, 'sound-off'), this.alarmSound);
  /** Called when another tab or screen came in front; the contents of the tabs come later. */
  front = () => {};
  /** The alarms of the other cars. @type {CarsAlarms | null} */
  others = null;
  #name = ''; // one, also where nothing can be stored
  /** @type {{arming: Arming, status: DeviceStatus} | null} */
  #phone = null;
  #isViewed = false;

  constructor() {
    const { access, vehicle } = document.documentElement.dataset;
    /** @returns {string} */
    const address = () => `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws${store.vehicle ? `?vehicle=${encodeURIComponent(store.vehicle)}` : ''}`;
    /** Where devices are paired, each socket needs a ticket. */
    this.admission = access === 'paired' ? new Admission(address, (why) => this.#shut(why)) : null;
    const store = /** @type {Store} */ (this.store = new Store(() => takeEarly() ?? this.admission?.dial(store.socket.trip) ?? new WebSocket(address()), () => (this.#name ||= deviceName(navigator.userAgent, keptHere())), ownName));
    store.vehicle = vehicle ?? '';
    store.painter.undrawn = undrawn = new Undrawn(() => store.frame, () => this.alarmSound.say('high'));
    stop = () => {
      store.stop();
      this.alarmSound.say(null);
    };
    const notify = notices(field(document, 'snacks'));
    this.control = new Control(store, notify, () => this.openPhone());
    /** A refusal because another page is in control is shown with a key that helps. @type {typeof notify} */
    this.say = (sentence, title, way) => notify(sentence, title, way ?? this.control.wayOf(sentence));
    this.cars = new Cars(store, this.say);
    this.cars.openControl = () => this.control.openSheet();
    this.router = new Router(store, this.say);
    this.tabs = new Tabs(this.monitor, () => this.front());
    this.router.onShown = () => this.shown();
    store.on('open', (hello) => this.admission?.greeted(hello));
    store.on('draw', () => this.draw());
  }

  draw() {
    this.router.draw();
    this.press.draw();
  }

  /** Another screen is shown. */
  shown() {
    this.tabs.place();
    this.front();
  }

  /** Sounds what the alarms need now. */
  sound() {
    const { alarmSound, router, store } = this;
    if (store.painter.drawing.isFailed) return; // then undrawn.js sounds
    const isServerLost = store.isSilent && store.isMonitoring && store.silence_s > 4;
    const own = soundOf(router.unclosed(store.heeded), { isServerLost, isLossAcknowledged: router.answered === lossKey(store.frame, store.isSilent) });
    alarmSound.say(this.others ? this.others.sound(own) : own);
  }

  /** Mounts what this phone can do: its sound, screen and position, and its report to the server. */
  mountPhone() {
    const arming = new Arming(this.alarmSound, new Phone(this.store));
    const status = new DeviceStatus();
    new Presence(this.store, arming, status, () => this.others?.announced ?? []);
    this.#phone = { arming, status };
    return arming;
  }

  /** Opens what shows this phone; it is fetched because it is seldom used. */
  openPhone() {
    import('./phone/this-phone.js').then(({ openThisPhone }) => {
      if (this.#phone) openThisPhone(this.store, this.#phone.arming, this.#phone.status);
    }).catch(() => this.say('The details of this device could not be loaded.', 'Not opened'));
  }

  /** Greys what a viewer may not do, once the page is a viewer's. */
  greyForViewer() {
    const { say, store } = this;
    if (!store.isViewer || this.#isViewed) return;
    this.#isViewed = true;
    import('./control/viewer.js').then(({ mountViewer }) => mountViewer(store, say)).catch(() => {}); // the server refuses it all the same
  }

  /** Shows the pairing screen: this device is not paired, or was removed just now. @param {import('./pairing/admission.js').Refusal} why */
  #shut(why) {
    const { router, say, store } = this;
    if (isOver) return;
    if (why.code === 'removed') forgetWork(keptHere());
    if (store.frame) {
      location.reload(); // a page that may not watch any more keeps nothing of the car; the screen then shows the reason
      return;
    }
    const setShut = (/** @type {boolean} */ isShut) => {
      router.isShut = isShut;
      router.draw();
    };
    setShut(true);
    import('./pairing/pairing.js').then(({ openPairing }) => openPairing(need(document, '#pairing'), {
      why,
      name: store.name,
      onPaired: () => {
        setShut(false);
        this.admission?.admit(store.socket);
      },
    })).catch(() => say('The pairing screen could not be loaded from the server. Reload the page.', 'Not paired'));
  }
}

/** Mounts what is seen at a glance. @param {Page} page */
function mountGlance({ cars, monitor, router, say, store }) {
  mountChip(monitor, cars);
  mountTopbar(monitor, store, say);
  mountStrip(monitor, store);
  mountVeil(monitor, store);
  mountGauge(need(monitor, '[data-part="gauge"]'), store);
  mountHelp(need(monitor, '[data-part="help"]'), store);
  mountNearest(need(monitor, '[data-part="nearest"]'), store);
  mountPedals(need(monitor, '[data-part="pedals"]'), store);
  mountPosition(need(monitor, '[data-part="position"]'), store);
  mountActionBar(monitor, store, router);
}

/** Mounts what alerts the operator, and what acts on the car. @param {Page} page */
function mountAlarms(page) {
  const { control, monitor, router, say, store } = page;
  store.on('beat', () => page.sound());
  store.on('tick', () => page.sound());
  page.others = new CarsAlarms(monitor, field(document, 'snacks'), page.cars);
  mountDialogs(store, router);
  mountSnackbar(field(document, 'snacks'), store, say);
  mountSlowing(monitor, store, control, say, (name) => page.cars.shortOf(name)); // after the dialogs: its count-down covers them
}

/** Mounts the screens and sheets; returns the tabs, whose contents come later. @param {Page} page @param {Arming} arming */
function mountScreens(page, arming) {
  const { cars, monitor, router, say, store, tabs } = page;
  mountChip(need(document, '#connect'), cars);
  const start = need(document, '#start');
  mountStart(start, store);
  if (start.querySelector('[data-f="who"]')) mountChip(start, cars); // the requested car may never answer: another one may be chosen
  mountConnect(need(document, '#connect'), store, router, arming);
  const contents = tabContents(monitor, store, say, (name) => router.isMonitorShown && tabs.shows(name) && (screens.open === null || isWall()));
  const screens = new Screens(monitor, store, () => page.front(), say);
  mountSheets();
  mountInstall(say);
  mountPreferences(page.alarmSound);
  mountDuty(store, say);
  return contents;
}

/** Shows what is below the fold of Home after what is seen first, a part at a time. @param {Page} page */
async function unfold({ monitor, router }) {
  if (!router.isMonitorShown) return;
  for (const part of monitor.querySelectorAll('[data-late][hidden]')) {
    await new Promise((resolve) => { requestAnimationFrame(resolve); });
    await breath();
    show(part, true);
  }
}

/** Listens to what concerns no single part. @param {Page} page @param {Arming} arming */
function listenEverywhere(page, arming) {
  const { control, monitor, router, say, store } = page;
  store.sync.whenOpen(() => page.greyForViewer());
  store.on('refused', (answer) => {
    control.note(answer);
    if (answer.heldBy) say(answer.reason, 'You are not in control'); // the part that sent the command may replace it
  });
  listen(field(need(document, '#sheet-menu'), 'this-phone'), 'click', () => {
    closeSheet(/** @type {HTMLDialogElement} */ (need(document, '#sheet-menu')));
    page.openPhone();
  });
  store.on('became', ({ kind, became, reason, cut }) => { const { text, title } = laterWords(kind, became, reason, cut); say(text, title); });
  store.on('gap', (gap) => say(`${gapWords(gap)}.`, 'This page was blind'));
  listen(document, 'keydown', () => { document.documentElement.dataset['keys'] = ''; }, { capture: true });
  listen(document, 'pointerdown', () => { delete document.documentElement.dataset['keys']; }, { capture: true });
  listen(field(monitor, 'sound-off'), 'click', () => arming.ask());
  listen(field(need(document, '#connect'), 'saved'), 'click', () => {
    import('./files/files-board.js').then(({ openSaved }) => openSaved(store, say, router)).catch(() => say('The recordings could not be loaded from the server. Try again.', 'Not opened'));
  });
}

/** Fetches and mounts what only a wide window, a keyboard or Back uses. @param {Page} page */
function mountDesk({ monitor, say, store, tabs }) {
  import('./shell/desk.js').then(({ mount }) => mount(monitor, store, tabs, say)).catch(() => say('The panes and the keys of a keyboard could not be loaded from the server. Reload the page.', 'Not complete'));
}

/** Fetches the screens that an operator may want when the server is gone. */
function prefetch() {
  for (const load of [() => import('./slowdown/slow-sheet.js'), () => import('./alarms/log.js'), () => import('./home/signals.js'), () => styled('sources'), () => styled('menu'), () => import('./scan/scan.js'), () => import('./home/drive-screen.js')]) load().catch(() => {});
}

/**
 * Resolves when the first values were painted, or after a time limit: in the background nothing is painted.
 * @param {Store} store
 * @returns {Promise<void>}
 */
function glanced(store) {
  return new Promise((resolve) => {
    setTimeout(resolve, WAITS_MS);
    let draws = 0;
    const off = store.on('draw', () => {
      if (!store.frame) return;
      draws += 1;
      if (draws === 1) requestAnimationFrame(() => setTimeout(resolve)); // the next picture begins: the first one is shown
      if (draws < 3) return;
      off();
      resolve(); // also where the browser's setTimeout never calls: alarms must come
    });
  });
}

void run();
