import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FixClock, Teller, whyOf } from '../../static/js/phone/phone-fix.js';

const HOUR_MS = 3_600_000;
const coords = { latitude: 32.23, longitude: -110.95, accuracy: 5, altitude: null, speed: NaN, heading: NaN };

/** A phone that began to ask at 0. */
function asking() {
  const teller = new Teller();
  teller.begin(0);
  return teller;
}

/** What goes out at this moment. @param {Teller} teller @param {number} now_ms @returns {any} */
function say(teller, now_ms) {
  const word = teller.due(now_ms);
  if (word) teller.told(word, now_ms);
  return word && ('why' in word ? word.why : word.fix);
}

test('the age of a fix by one clock is what its stamp says', () => {
  const clock = new FixClock();
  assert.equal(clock.note(1000, 1400), 400);
  assert.deepEqual([5000, 6000, 7000].map((at) => clock.note(at, at + 700)), [700, 700, 700]);
  assert.equal(clock.note(8000, 11_000), 3000); // one that came late
});

test('a first fix from a cache is as old as it says', () => {
  assert.equal(new FixClock().note(0, 40_000), 40_000);
});

for (const [name, off_ms] of /** @type {[string, number][]} */ ([['hours ahead', 7 * HOUR_MS], ['hours behind', -7 * HOUR_MS], ['a minute ahead', 60_000], ['two seconds behind', -2000]])) {
  test(`a browser's clock that is ${name} makes no fix old or young`, () => {
    const clock = new FixClock();
    const lags = [300, 500, 400, 300, 2300, 300].map((lag_ms, i) => clock.note(i * 1000, i * 1000 + lag_ms + off_ms));
    assert.deepEqual(lags.slice(2), [100, 0, 2000, 0]); // from the third on
    assert.ok(lags.every((lag_ms) => lag_ms >= 0));
  });
}

test('a browser’s clock that is set while it runs is found out within ten fixes', () => {
  const clock = new FixClock();
  for (let i = 0; i < 20; i += 1) clock.note(i * 1000, i * 1000 + 200);
  const ages = Array.from({ length: 12 }, (_, i) => clock.note((20 + i) * 1000, (20 + i) * 1000 + 200 + HOUR_MS));
  assert.equal(ages[0], HOUR_MS + 200); // too old to be used: nothing wrong is told
  assert.deepEqual(ages.slice(9), [0, 0, 0]);
  const back = Array.from({ length: 3 }, (_, i) => clock.note((40 + i) * 1000, (40 + i) * 1000 + 200));
  assert.ok(back.every((age_ms) => age_ms <= 200));
});

test('a fix is told once, with its age at sending, and what is no number is null', () => {
  const teller = asking();
  teller.fix(coords, 1_700_000_000_000, 100, 1_700_000_000_300);
  assert.deepEqual(teller.due(250), {
    fix: { lat_deg: 32.23, lon_deg: -110.95, accuracy_m: 5, alt_m: null, speed_mps: null, heading_deg: null, at_ms: 1_700_000_000_000, age_s: 0.45 },
  });
  say(teller, 250);
  assert.equal(say(teller, 3000), null);
});

test('at most one fix a second, the newest', () => {
  const teller = asking();
  const told = [];
  for (let now_ms = 0; now_ms <= 5000; now_ms += 100) {
    teller.fix({ ...coords, accuracy: now_ms }, now_ms, now_ms, now_ms);
    const fix = say(teller, now_ms);
    if (fix) told.push(fix.accuracy_m);
  }
  assert.deepEqual(told, [0, 1000, 2000, 3000, 4000, 5000]);
});

test('one fix that the browser tells again and again grows old all the same', () => {
  const teller = asking();
  for (let now_ms = 0; now_ms <= 4000; now_ms += 500) teller.fix(coords, 0, now_ms, now_ms);
  assert.equal(teller.why(4000), null);
  assert.equal(teller.why(4001), 'timeout');
});

test('until the first fix comes it is waited for, and that is told every three seconds', () => {
  const teller = asking();
  const told = [];
  for (let now_ms = 0; now_ms <= 7000; now_ms += 200) if (say(teller, now_ms) === 'timeout') told.push(now_ms);
  assert.deepEqual(told, [0, 3000, 6000]);
});

test('a single failure between fixes is none, a lasting one is told', () => {
  const teller = asking();
  teller.fix(coords, 0, 0, 0);
  say(teller, 0);
  teller.fail('unavailable');
  assert.equal(say(teller, 1000), null);
  teller.fix(coords, 1500, 1500, 1500);
  assert.ok(say(teller, 1500).lat_deg);
  teller.fail('unavailable');
  assert.equal(say(teller, 5500), null);
  assert.equal(say(teller, 5501), 'unavailable');
  teller.fix(coords, 6000, 6000, 6000);
  assert.ok(say(teller, 6000).lat_deg, 'a fix after a reason waits for nothing');
});

test('a refusal is told at once, over everything, and forgotten when it is asked again', () => {
  const teller = asking();
  teller.fix(coords, 0, 0, 0);
  say(teller, 0);
  teller.fail('denied');
  assert.equal(say(teller, 100), 'denied');
  teller.isHidden = true;
  assert.equal(say(teller, 200), null);
  assert.equal(teller.why(200), 'denied');
  teller.isHidden = false;
  teller.begin(300);
  assert.equal(say(teller, 300), 'timeout');
});

test('in the background there is no position, whatever came before', () => {
  const teller = asking();
  teller.fix(coords, 0, 0, 0);
  teller.isHidden = true;
  assert.equal(say(teller, 100), 'hidden');
  teller.isHidden = false;
  assert.ok(say(teller, 200).lat_deg);
});

test('a new connection is told anew, and what did not go out is told later', () => {
  const teller = asking();
  teller.fail('denied');
  assert.equal(say(teller, 0), 'denied');
  assert.equal(say(teller, 100), null);
  teller.forget();
  assert.deepEqual(teller.due(200), { why: 'denied' });
  assert.deepEqual(teller.due(300), { why: 'denied' });
});

test('the browser’s three errors', () => {
  assert.deepEqual([1, 2, 3, 99].map(whyOf), ['denied', 'unavailable', 'timeout', 'unavailable']);
});
