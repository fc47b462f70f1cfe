// When a page may be loaded anew, and how it can be put among a phone's apps.

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { wayToInstall } from '../../static/js/shell/install.js';
import { holdsReload } from '../../static/js/boot/service-worker.js';

const alarm = (priority, state) => ({ priority, state });
const frame = (more = {}) => ({ alarms: [], decelerate: { state: 'off' }, signals: {}, ...more });
const SEEN = { isSilent: false, isMonitoring: false, hasDialog: false };
const speed = (speed_mps) => ({ signals: { speed: { value: speed_mps === null ? null : { speed_mps } } } });

for (const [name, state, seen, why] of [
  ['nothing is monitored', frame(), {}, null],
  ['no frame yet', null, {}, 'the server does not answer'],
  ['the server is silent', frame(), { isSilent: true }, 'the server does not answer'],
  ['a critical alarm', frame({ alarms: [alarm('critical', 'UNACKED')] }), {}, 'an alarm is active'],
  ['a critical alarm, acknowledged', frame({ alarms: [alarm('critical', 'ACKED')] }), {}, 'an alarm is active'],
  ['a warning', frame({ alarms: [alarm('warning', 'UNACKED')] }), {}, 'an alarm is active'],
  ['a warning that is over, not acknowledged', frame({ alarms: [alarm('warning', 'RTN_UNACKED')] }), {}, 'an alarm is active'],
  ['a warning, acknowledged', frame({ alarms: [alarm('warning', 'ACKED')] }), {}, null],
  ['a warning, shelved', frame({ alarms: [alarm('warning', 'SHELVED')] }), {}, null],
  ['an advisory', frame({ alarms: [alarm('advisory', 'UNACKED')] }), {}, null],
  ['an alarm of the live car beside a recording', frame({ replay: {}, live: { alarms: [alarm('critical', 'UNACKED')] } }), {}, 'an alarm is active'],
  ['a recording', frame({ replay: {}, live: { alarms: [] } }), {}, 'a recording is shown'],
  ['a dialog', frame(), { hasDialog: true }, 'a dialog is open'],
  ['the car is slowed', frame({ decelerate: { state: 'ordered' } }), {}, 'the car is being slowed'],
  ['a car that drives', frame(speed(3)), { isMonitoring: true }, 'the car moves'],
  ['a car that reverses', frame(speed(-3)), { isMonitoring: true }, 'the car moves'],
  ['a car that stands', frame(speed(0.08)), { isMonitoring: true }, null],
  ['a car of unknown speed', frame(speed(null)), { isMonitoring: true }, 'the car moves'],
  ['a car whose speed is no number', frame(speed(NaN)), { isMonitoring: true }, 'the car moves'],
]) {
  test(`reload: ${name}`, () => assert.equal(holdsReload(/** @type {any} */ (state), { ...SEEN, ...seen }), why));
}

const AGENTS = {
  iphone: 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 Version/18.0 Mobile/15E148 Safari/604.1',
  ipad: 'Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/605.1.15 Version/18.0 Safari/605.1.15',
  pixel: 'Mozilla/5.0 (Linux; Android 15; Pixel 7) AppleWebKit/537.36 Chrome/140.0.0.0 Mobile Safari/537.36',
};

for (const [name, phone, way] of [
  ['an iPhone', { agent: AGENTS.iphone, touchPoints: 5 }, 'apple'],
  ['an iPad, which calls itself a Mac', { agent: AGENTS.ipad, touchPoints: 5 }, 'apple'],
  ['a Mac', { agent: AGENTS.ipad, touchPoints: 0 }, null],
  ['a browser that offers it', { agent: AGENTS.pixel, touchPoints: 5, hasOffer: true }, 'offer'],
  ['a browser that does not', { agent: AGENTS.pixel, touchPoints: 5 }, null],
  ['the installed page', { agent: AGENTS.iphone, touchPoints: 5, isInstalled: true }, null],
  ['the installed page, with an offer', { agent: AGENTS.pixel, touchPoints: 5, isInstalled: true, hasOffer: true }, null],
]) {
  test(`install: ${name}`, () => assert.equal(wayToInstall({ isInstalled: false, hasOffer: false, .../** @type {any} */ (phone) }), way));
}
