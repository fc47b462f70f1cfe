// The page of all cars for one person: what needs a person first, each car in a row, the map. Its own entry, beside main.js.

import '../boot/trusted-types.js';
import { Admission } from '../pairing/admission.js';
import { AlarmSound } from '../alarms/alarm-sound.js';
import { Arming } from '../boot/arming.js';
import { deviceName, keptHere } from '../control/device-name.js';
import { ownName } from '../control/own-name.js';
import { Presence } from '../control/presence.js';
import { DeviceStatus } from '../phone/device-status.js';
import { FleetActs } from './fleet-acts.js';
import { FleetStore } from './fleet-store.js';
import { FleetView } from './fleet-view.js';
import { mountCovers } from './fleet-lost.js';
import { Press } from './press.js';
import { Undrawn } from './undrawn.js';
import { loudest } from './fleet-layout.js';
import { field, listen, need } from '../core/dom.js';

/** A silence of all cars longer than this is announced by sound [s]. */
const LOUD_S = 4;

/** @type {(() => void)[]} */
const stops = [];
/** @type {Undrawn | null} */
let undrawn = null;

/** The page of the device's admission, which leads back here. */
const PAIRING = '/?then=/fleet';

function begin() {
  const { dataset } = document.documentElement;
  const address = () => `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws?fleet=1`;
  const admission = dataset['admission'] === 'paired' ? new Admission(address, () => location.replace(PAIRING)) : null;
  const self = { name: deviceName(navigator.userAgent, keptHere()), page: ownName() };
  const store = new FleetStore(() => admission?.dial(store.socket.trip) ?? new WebSocket(address()), self);
  store.on('open', (hello) => admission?.greeted(hello));
  const alarmSound = new AlarmSound();
  store.painter.undrawn = undrawn = new Undrawn(() => frameOf(store), () => alarmSound.say('high'));
  stops.push(() => store.stop(), () => alarmSound.say(null));
  const root = need(document, '#fleet');
  const acts = new FleetActs(store, field(document, 'snacks'));
  const arming = new Arming(alarmSound, /** @type {any} */ ({ armed: 'missing', arm: () => {} })); // this page shares no position
  const view = new FleetView(root, store, acts, new Press(field(root, 'sound-off'), alarmSound, () => arming.ask())); // the screen stays awake too
  store.on('draw', () => view.draw());
  mountCovers(store);
  new Presence(/** @type {any} */ (store), arming, new DeviceStatus(), () => (store.isSilent ? [] : (store.cars?.cars ?? []).map(({ name }) => name)));
  let isHushed = false;
  const sound = () => {
    if (store.painter.drawing.isFailed) return; // then the undrawn part sounds
    const { view: { lost, silence_s, heard_ms }, items } = view.look();
    if (lost === null) isHushed = false;
    const isLoud = lost !== null && heard_ms !== null && silence_s > LOUD_S && !isHushed;
    alarmSound.say(isLoud ? 'high' : lost ? null : loudest(items));
  };
  store.on('beat', sound);
  store.on('tick', sound);
  listen(document, 'keydown', () => { dataset['keys'] = ''; }, { capture: true });
  listen(document, 'pointerdown', () => { delete dataset['keys']; }, { capture: true });
  listen(field(root, 'sound-off'), 'click', () => arming.ask());
  listen(field(root, 'retry'), 'click', () => store.retry());
  listen(field(root, 'hush'), 'click', () => {
    isHushed = true;
    sound();
  });
  store.start();
}

/** The alarms of all cars as the undrawn part reads them: as of one car. @param {FleetStore} store @returns {any} */
function frameOf(store) {
  const alarms = [];
  const all = store.cars?.cars ?? [];
  for (let i = 0; i < all.length; i += 1) {
    const car = all[i];
    const worst = car?.summary?.worst;
    if (car && worst) alarms.push({ ...worst, title: `${car.name}: ${worst.title}` });
  }
  return { session: { phase: all.length ? 'monitoring' : 'idle', paused: false }, alarms };
}

try {
  begin();
} catch (error) {
  console.error(error);
  try {
    for (const stop of stops) stop(); // a page that cannot alert anybody must not show values that look live
  } finally {
    const shown = undrawn ?? new Undrawn(() => null, () => {});
    shown.show();
  }
}
