// The page's beginning: one store, one alarm sound, every panel at its place.

import './boot/trusted-types.js';
import { thenOf } from './boot/pairing-token.js';

import { Admission } from './pairing/admission.js';
import { soundOf } from './alarms/alarm-layout.js';
import { Arming } from './boot/arming.js';
import { deviceName, keptHere } from './control/device-name.js';
import { breath, field, listen, need, show } from './core/dom.js';
import { gapWords } from './core/event-log.js';
import { takeEarly } from './boot/early-socket.js';
import { LazyTab } from './shell/lazy-tab.js';
import { forgetWork } from './boot/forget.js';
import { giveUp } from './boot/give-up.js';
import { DeviceStatus } from './phone/device-status.js';
import { holdTaps } from './boot/held-taps.js';
import { notices } from './shell/notice.js';
import { ownName } from './control/own-name.js';
import { Router } from './shell/router.js';
import { Phone } from './phone/phone.js';
import { Presence } from './control/presence.js';
import { Screens } from './shell/screens.js';
import { closeSheet, mountSheets } from './shell/sheet.js';
import { Store } from './core/store.js';
import { Tabs } from './shell/tabs.js';
import { Undrawn } from './shell/undrawn.js';
import { AlarmSound } from './alarms/alarm-sound.js';
import { lossKey, mount as mountDialogs } from './shell/dialogs.js';
import { mount as mountBadge } from './shell/badge.js';
import { mount as mountChecks } from './alarms/checks.js';
import { mount as mountConnect } from './shell/connect.js';
import { Control, mount as mountControl } from './control/control.js';
import { mount as mountGauge } from './home/gauge.js';
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

/** The rest of the page waits for the first values so long, and no longer [ms]. */
const WAITS_MS = 400;

/** Ends what has begun. */
let stop = () => {};
let isOver = false;
/** @type {Undrawn | null} */
let undrawn = null;

void run();

/** Nothing here may need more of the browser than the language itself: it is what remains when the browser fails. */
async function run() {
  try {
    await begin();
  } catch (error) {
    isOver = true;
    console.error(error);
    try {
      stop(); // values that look alive, on a page that could not ask for anybody, would be a lie
    } finally {
      try {
        giveUp(); // first: a dialog that is closed and not removed would take that for an acknowledgement
      } finally {
        undrawn?.show();
      }
    }
  }
}

/**
 * First what is seen at a glance, with its first values; then, part after part, what answers a finger. As one piece it would
 * keep a slow phone from the values for a third of a second, and from everything else for as long.
 */
async function begin() {
  const release = holdTaps();
  const vehicle = document.documentElement.dataset['vehicle'];
  const address = `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws${vehicle ? `?vehicle=${encodeURIComponent(vehicle)}` : ''}`;

  /** Where devices are paired, each socket needs a ticket. */
  const admission = document.documentElement.dataset['access'] === 'paired' ? new Admission(address, shut) : null;
  let name = ''; // one, also where nothing can be kept
  const store = new Store(() => takeEarly() ?? admission?.dial() ?? new WebSocket(address), () => (name ||= deviceName(navigator.userAgent, keptHere())), ownName);
  const alarmSound = new AlarmSound();
  store.painter.undrawn = undrawn = new Undrawn(() => store.frame, () => alarmSound.say('high'));
  stop = () => {
    store.stop();
    alarmSound.say(null);
  };
  const monitor = need(document, '#monitor');
  const tell = notices(field(document, 'snacks'));
  const control = new Control(store, tell, openPhone);
  /** What was refused because another is in control is said with a key that helps. @type {typeof tell} */
  const say = (sentence, title, way) => tell(sentence, title, way ?? control.wayOf(sentence));
  const router = new Router(store, say);
  /** Called when another tab or screen came in front; the tabs' contents come later. */
  let front = () => {};
  const tabs = new Tabs(monitor, () => front());
  router.onShown = () => {
    tabs.place();
    front();
  };
  store.on('draw', draw);
  mountTopbar(monitor, store, say);
  mountStrip(monitor, store);
  mountVeil(monitor, store);
  mountGauge(need(monitor, '[data-part="gauge"]'), store);
  mountNearest(need(monitor, '[data-part="nearest"]'), store);
  mountPedals(need(monitor, '[data-part="pedals"]'), store);
  mountPosition(need(monitor, '[data-part="position"]'), store);
  mountActionBar(monitor, store, router);
  // Any touch lets a browser sound; the first one anywhere arms the alarms again after a reload.
  for (const type of ['pointerup', 'keydown']) listen(document, type, () => alarmSound.isRunning || alarmSound.arm(), { capture: true });
  store.start();
  await glanced(store);
  store.sync.greet();

  // What asks for the operator, and what acts on the car.
  store.on('beat', speak);
  store.on('tick', speak);
  mountDialogs(store, router);
  mountSnackbar(field(document, 'snacks'), store, say);
  mountSlowing(monitor, store, control, say); // after the dialogs: its count-down lies over them
  await breath();
  mountControl(monitor, field(document, 'snacks'), store, control);
  await breath();
  const arming = new Arming(alarmSound, new Phone(store));
  const deviceStatus = new DeviceStatus();
  new Presence(store, arming, deviceStatus);
  await breath();
  mountStart(need(document, '#start'), store);
  mountConnect(need(document, '#connect'), store, router, arming);
  const contents = lazyTabs(monitor, store, say, (name) => router.isMonitorShown && tabs.shows(name) && screens.open === null);
  const screens = new Screens(monitor, store, () => front());
  mountSheets();
  mountInstall(say);
  mountPreferences(alarmSound);
  await breath();
  mountReach(need(monitor, '[data-part="reach"]'), store, openPhone);
  mountChecks(need(monitor, '[data-part="checks"]'), store);
  await breath();
  mountTrends(need(monitor, '[data-part="trends"]'), store);
  await breath();
  mountBadge(store);
  router.onShown = () => {
    tabs.place();
    front();
    unfold();
  };

  /** What lies under the fold of Home comes after what is seen first, a part at a time. */
  async function unfold() {
    if (!router.isMonitorShown) return;
    for (const part of monitor.querySelectorAll('[data-late][hidden]')) {
      await new Promise((resolve) => { requestAnimationFrame(resolve); });
      await breath();
      show(part, true);
    }
  }

  front = () => {
    queueMicrotask(() => {
      for (const content of contents) content.look();
    });
  };

  /** What this phone can do is looked at seldom. */
  function openPhone() {
    import('./phone/this-phone.js').then(({ openThisPhone }) => openThisPhone(store, arming, deviceStatus)).catch(() => say('What shows this phone could not be fetched.', 'Not opened'));
  }

  /** This device is not paired, or was removed just now. @param {import('./pairing/admission.js').Refusal} why */
  function shut(why) {
    if (isOver) return;
    if (why.code === 'removed') forgetWork(keptHere());
    if (store.frame) {
      location.reload(); // nothing of the car stays on a page that may not look any more; the screen then says the reason
      return;
    }
    router.isShut = true;
    router.draw();
    import('./pairing/pairing.js').then(({ openPairing }) => openPairing(need(document, '#pairing'), {
      why,
      name: store.name,
      onPaired: () => {
        router.isShut = false;
        router.draw();
        admission?.admit();
      },
    })).catch(() => say('The screen for pairing could not be fetched from the server. Load the page again.', 'Not paired'));
  }

  /** What a viewer may not do is greyed; once somebody is one, it is told so. */
  let isViewed = false;
  function greet() {
    if (!store.isViewer || isViewed) return;
    isViewed = true;
    import('./control/viewer.js').then(({ mountViewer }) => mountViewer(store, say)).catch(() => {}); // the server refuses it all the same
  }
  store.sync.whenOpen(greet);

  function draw() {
    router.draw();
    show(field(monitor, 'sound-off'), alarmSound.isPossible ? !alarmSound.isRunning : false);
  }

  function speak() {
    if (store.painter.drawing.isFailed) return; // undrawn.js sounds
    const isServerLost = store.isSilent && store.isMonitoring && store.silence_s > 4;
    alarmSound.say(soundOf(router.unclosed(store.heeded), { isServerLost, isLossAcknowledged: router.answered === lossKey(store.frame, store.isSilent) }));
  }

  store.on('refused', (answer) => {
    control.note(answer);
    if (answer.heldBy) say(answer.reason, 'You are not in control'); // whoever ordered it may say it better
  });
  listen(field(need(document, '#sheet-menu'), 'this-phone'), 'click', () => {
    closeSheet(/** @type {HTMLDialogElement} */ (need(document, '#sheet-menu')));
    openPhone();
  });
  store.on('gap', (gap) => say(`${gapWords(gap)}.`, 'This page was blind'));
  listen(document, 'keydown', () => { document.documentElement.dataset['keys'] = ''; }, { capture: true });
  listen(document, 'pointerdown', () => { delete document.documentElement.dataset['keys']; }, { capture: true });
  listen(field(monitor, 'sound-off'), 'click', () => arming.ask());
  listen(field(need(document, '#connect'), 'saved'), 'click', () => {
    import('./files/files-board.js').then(({ openSaved }) => openSaved(store, say, router)).catch(() => say('The recordings could not be fetched from the server. Try again.', 'Not opened'));
  });

  // A link may lead to a moment of a recording.
  const asked = new URLSearchParams(location.search);
  const then = thenOf(asked.get('then'));
  const recording = asked.get('replay');
  let isAsked = false;
  store.sync.whenOpen(() => {
    if (isAsked) return;
    isAsked = true;
    if (asked.has('then')) history.replaceState(history.state, '', location.pathname);
    if (then) location.assign(then); // a link in a mail: now that this device is known
    if (recording) import('./replay/replay.js').then(({ openReplay }) => openReplay(recording, store, say, Number(asked.get('t')) || 0)).catch(() => say('The replay could not be loaded.', 'Not replayed'));
  });
  draw();
  front();
  unfold();
  release();
  // What outlasts this visit is seen to once the page stands.
  setTimeout(() => import('./boot/service-worker.js').then(({ Shell }) => new Shell(store, say)).catch(() => {}), 2000);
  // The screens an operator may want when the server is gone are fetched while it is there, once the page has begun.
  setTimeout(prefetch, 10_000);
  function prefetch() {
    for (const load of [() => import('./slowdown/slow-sheet.js'), () => import('./alarms/log.js'), () => import('./home/signals.js'), () => import('./scan/scan.js'), () => import('./home/chart.js')]) load().catch(() => {});
  }
}

/**
 * The tabs whose content is fetched when they first come to the front.
 * @param {HTMLElement} monitor
 * @param {Store} store
 * @param {ReturnType<typeof notices>} say
 * @param {(name: string) => boolean} isFront
 */
function lazyTabs(monitor, store, say, isFront) {
  const panel = (/** @type {string} */ name) => need(monitor, `[data-panel="${name}"]`);
  const shown = (/** @type {string} */ name) => () => isFront(name);
  return [
    new LazyTab(panel('scan'), {
      what: 'The scan', state: 'none-words', isShown: shown('scan'), fetch: () => import('./scan/scan.js'),
      mount: ({ mount }) => {
        const scan = mount(panel('scan'), store);
        const look = () => scan.setFront(isFront('scan')); // sent and drawn only while it is in front
        look();
        return { look };
      },
    }),
    new LazyTab(panel('map'), {
      what: 'The map', state: 'none-words', isShown: shown('map'), isNear: true, fetch: () => import('./map/map.js'),
      mount: ({ mount }) => {
        mount(panel('map'), store, shown('map'), say);
        return {};
      },
    }),
    new LazyTab(panel('files'), {
      what: 'The recordings', state: 'files-state', isShown: shown('files'), fetch: () => import('./files/files.js'),
      mount: ({ mount }) => mount(panel('files'), store, say, shown('files')),
    }),
    new LazyTab(panel('settings'), {
      what: 'The settings', state: 'settings-state', isShown: shown('settings'), fetch: () => import('./settings/settings.js'),
      mount: ({ mount }) => {
        mount(panel('settings'), store, say, shown('settings'));
        return {};
      },
    }),
  ];
}

/**
 * Until the first values were painted. Where none come, or nothing is painted, as in the background, the page goes on without.
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
      if (draws === 1) requestAnimationFrame(() => setTimeout(resolve)); // the next picture begins: this one was shown
      if (draws < 3) return;
      off();
      resolve(); // also where the browser's setTimeout never calls: what asks for the operator must come
    });
  });
}
