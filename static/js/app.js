// The page's beginning: one store, one voice, every panel at its place.

import './trusted-types.js';
import { thenOf } from './pair-link.js';

import { Admission } from './admission.js';
import { soundOf } from './alarm-layout.js';
import { Arming } from './arming.js';
import { deviceName, keptHere } from './device.js';
import { breath, field, listen, need, show } from './dom.js';
import { gapWords } from './events.js';
import { takeEarly } from './early-socket.js';
import { FilesTab } from './files-tab.js';
import { forgetWork } from './forget.js';
import { giveUp } from './give-up.js';
import { Handset } from './handset.js';
import { holdTaps } from './held-taps.js';
import { MapTab } from './map-tab.js';
import { notices } from './notice.js';
import { ownName } from './own-name.js';
import { Page } from './page.js';
import { Phone } from './phone.js';
import { Presence } from './presence.js';
import { ScanTab } from './scan-tab.js';
import { Screens } from './screens.js';
import { SettingsTab } from './settings-tab.js';
import { closeSheet, mountSheets } from './sheet.js';
import { Store } from './store.js';
import { Tabs } from './tabs.js';
import { Undrawn } from './undrawn.js';
import { Voice } from './voice.js';
import { lossKey, mount as mountDialogs } from './dialogs.js';
import { mount as mountBadge } from './badge.js';
import { mount as mountChecks } from './checks.js';
import { mount as mountConnect } from './connect.js';
import { Control, mount as mountControl } from './control.js';
import { mount as mountGauge } from './gauge.js';
import { mount as mountInstall } from './install.js';
import { mount as mountNearest } from './nearest.js';
import { mount as mountPedals } from './pedals.js';
import { mount as mountPosition } from './position.js';
import { mount as mountPreferences } from './preferences.js';
import { mount as mountRail } from './rail.js';
import { mount as mountReach } from './reach.js';
import { mount as mountSlowing } from './slowing.js';
import { mount as mountSnackbar } from './snackbar.js';
import { mount as mountStart } from './start.js';
import { mount as mountStrip } from './strip.js';
import { mount as mountTopbar } from './topbar.js';
import { mount as mountTrends } from './trends.js';
import { mount as mountVeil } from './veil.js';

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
        giveUp(); // it removes the dialogs: closed, an alarm's would be taken for acknowledged
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
  const voice = new Voice();
  store.undrawn = undrawn = new Undrawn(() => store.frame, () => voice.say('high'));
  stop = () => {
    store.stop();
    voice.say(null);
  };
  const monitor = need(document, '#monitor');
  const tell = notices(field(document, 'snacks'));
  const control = new Control(store, tell, openPhone);
  /** What was refused because another is in control is said with a key that helps. @type {typeof tell} */
  const say = (sentence, title, way) => tell(sentence, title, way ?? control.wayOf(sentence));
  const page = new Page(store, say);
  /** Called when another tab or screen came in front; the tabs' contents come later. */
  let front = () => {};
  const tabs = new Tabs(monitor, () => front());
  page.onShown = () => {
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
  mountRail(monitor, store, page);
  // Any touch lets a browser sound; the first one anywhere arms the alarms again after a reload.
  for (const type of ['pointerup', 'keydown']) listen(document, type, () => voice.isRunning || voice.arm(), { capture: true });
  store.start();
  await glanced(store);
  store.greet();

  // What asks for the operator, and what acts on the car.
  store.on('beat', speak);
  store.on('tick', speak);
  mountDialogs(store, page);
  mountSnackbar(field(document, 'snacks'), store, say);
  mountSlowing(monitor, store, control, say); // after the dialogs: its count-down lies over them
  await breath();
  mountControl(monitor, field(document, 'snacks'), store, control);
  await breath();
  const arming = new Arming(voice, new Phone(store));
  const handset = new Handset();
  new Presence(store, arming, handset);
  await breath();
  mountStart(need(document, '#start'), store);
  mountConnect(need(document, '#connect'), store, page, arming);
  const scan = new ScanTab(need(monitor, '[data-panel="scan"]'), store);
  const map = new MapTab(need(monitor, '[data-panel="map"]'), store, () => page.isMonitorShown && tabs.shows('map') && screens.open === null, say);
  const files = new FilesTab(need(monitor, '[data-panel="files"]'), store, say, () => page.isMonitorShown && tabs.shows('files') && screens.open === null);
  const settings = new SettingsTab(need(monitor, '[data-panel="settings"]'), store, say, () => page.isMonitorShown && tabs.shows('settings') && screens.open === null);
  const screens = new Screens(monitor, store, () => front());
  mountSheets();
  mountInstall(say);
  mountPreferences(voice);
  await breath();
  mountReach(need(monitor, '[data-part="reach"]'), store, openPhone);
  mountChecks(need(monitor, '[data-part="checks"]'), store);
  await breath();
  mountTrends(need(monitor, '[data-part="trends"]'), store);
  await breath();
  mountBadge(store);
  page.onShown = () => {
    tabs.place();
    front();
    unfold();
  };

  /** What lies under the fold of Home comes after what is seen first, a part at a time. */
  async function unfold() {
    if (!page.isMonitorShown) return;
    for (const part of monitor.querySelectorAll('[data-late][hidden]')) {
      await new Promise((resolve) => { requestAnimationFrame(resolve); });
      await breath();
      show(part, true);
    }
  }

  /** The scan is sent and drawn only while its tab is in front and nothing lies over it; Settings is loaded once it is. */
  front = () => {
    queueMicrotask(() => {
      scan.setFront(page.isMonitorShown && tabs.shows('scan') && screens.open === null);
      map.look();
      files.look();
      settings.look();
    });
  };

  /** What this phone can do is looked at seldom. */
  function openPhone() {
    import('./this-phone.js').then(({ openThisPhone }) => openThisPhone(store, arming, handset)).catch(() => say('What shows this phone could not be fetched.', 'Not opened'));
  }

  /** This device is not paired, or was removed just now. @param {import('./admission.js').Refusal} why */
  function shut(why) {
    if (isOver) return;
    if (why.code === 'removed') forgetWork(keptHere());
    if (store.frame) {
      location.reload(); // nothing of the car stays on a page that may not look any more; the screen then says the reason
      return;
    }
    page.isShut = true;
    page.draw();
    import('./pairing.js').then(({ openPairing }) => openPairing(need(document, '#pairing'), {
      why,
      name: store.name,
      onPaired: () => {
        page.isShut = false;
        page.draw();
        admission?.admit();
      },
    })).catch(() => say('The screen for pairing could not be fetched from the server. Load the page again.', 'Not paired'));
  }

  /** What a viewer may not do is greyed; once somebody is one, it is told so. */
  let isViewed = false;
  function greet() {
    if (!store.isViewer || isViewed) return;
    isViewed = true;
    import('./viewer.js').then(({ mountViewer }) => mountViewer(store, say)).catch(() => {}); // the server refuses it all the same
  }
  store.whenOpen(greet);

  function draw() {
    page.draw();
    show(field(monitor, 'sound-off'), voice.isPossible ? !voice.isRunning : false);
  }

  function speak() {
    if (store.drawing.isFailed) return; // undrawn.js sounds
    const isServerLost = store.isSilent && store.isMonitoring && store.silence_s > 4;
    voice.say(soundOf(page.unclosed(store.heeded), { isServerLost, isLossAcknowledged: page.answered === lossKey(store.frame, store.isSilent) }));
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
    import('./files-board.js').then(({ openSaved }) => openSaved(store, say, page)).catch(() => say('The recordings could not be fetched from the server. Try again.', 'Not opened'));
  });

  // A link may lead to a moment of a recording.
  const asked = new URLSearchParams(location.search);
  const then = thenOf(asked.get('then'));
  const recording = asked.get('replay');
  let isAsked = false;
  store.whenOpen(() => {
    if (isAsked) return;
    isAsked = true;
    if (asked.has('then')) history.replaceState(history.state, '', location.pathname);
    if (then) location.assign(then); // a link in a mail: now that this device is known
    if (recording) import('./replay.js').then(({ openReplay }) => openReplay(recording, store, say, Number(asked.get('t')) || 0)).catch(() => say('The replay could not be loaded.', 'Not replayed'));
  });
  draw();
  front();
  unfold();
  release();
  // What outlasts this visit is seen to once the page stands.
  setTimeout(() => import('./shell.js').then(({ Shell }) => new Shell(store, say)).catch(() => {}), 2000);
  // The screens an operator may want when the server is gone are fetched while it is there, once the page has begun.
  setTimeout(prefetch, 10_000);
  function prefetch() {
    for (const load of [() => import('./slow-sheet.js'), () => import('./log.js'), () => import('./signals.js'), () => import('./scan.js'), () => import('./chart.js')]) load().catch(() => {});
  }
}

/**
 * Until the first values were painted. Where none come, or nothing is painted, as in the background, the page goes on without.
 * @param {Store} store
 * @returns {Promise<void>}
 */
function glanced(store) {
  return new Promise((resolve) => {
    setTimeout(resolve, WAITS_MS);
    const off = store.on('draw', () => {
      if (!store.frame) return;
      off();
      requestAnimationFrame(() => setTimeout(resolve)); // the next picture begins: this one was shown
    });
  });
}
