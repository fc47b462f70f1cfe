import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FixClock, PositionReporter, whyOf } from '../../static/js/phone/phone-fix.js';

const HOUR_MS = 3_600_000;
const coords = { latitude: 32.23, longitude: -110.95, accuracy: 5, altitude: null, speed: NaN, heading: NaN };

/** A phone that began to ask at 0. */
function asking() {
  const reporter = new PositionReporter();
  reporter.begin(0);
  return reporter;
}

/** What goes out at this moment. @param {PositionReporter} reporter @param {number} now_ms @returns {any} */
function say(reporter, now_ms) {
  const report = reporter.due(now_ms);
  if (report) reporter.sent(report, now_ms);
  return report && ('why' in report ? report.why : report.fix);
}

test('the age of a fix by one clock follows from its stamp', () => {
  const clock = new FixClock();
  assert.equal(clock.note(1000, 1400), 400);
  assert.deepEqual([5000, 6000, 7000].map((at) => clock.note(at, at + 700)), [700, 700, 700]);
  assert.equal(clock.note(8000, 11_000), 3000); // one that came late
});

test('a first fix from a cache is as old as its stamp', () => {
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
  assert.equal(ages[0], HOUR_MS + 200); // too old to be used: nothing wrong is sent
  assert.deepEqual(ages.slice(9), [0, 0, 0]);
  const back = Array.from({ length: 3 }, (_, i) => clock.note((40 + i) * 1000, (40 + i) * 1000 + 200));
  assert.ok(back.every((age_ms) => age_ms <= 200));
});

test('a fix is sent once, with its age at sending, and what is no number is null', () => {
  const reporter = asking();
  reporter.fix(coords, 1_700_000_000_000, 100, 1_700_000_000_300);
  assert.deepEqual(reporter.due(250), {
    fix: { lat_deg: 32.23, lon_deg: -110.95, accuracy_m: 5, alt_m: null, speed_mps: null, heading_deg: null, at_ms: 1_700_000_000_000, age_s: 0.45 },
  });
  say(reporter, 250);
  assert.equal(say(reporter, 3000), null);
});

test('at most one fix a second, the newest', () => {
  const reporter = asking();
  const sent = [];
  for (let now_ms = 0; now_ms <= 5000; now_ms += 100) {
    reporter.fix({ ...coords, accuracy: now_ms }, now_ms, now_ms, now_ms);
    const fix = say(reporter, now_ms);
    if (fix) sent.push(fix.accuracy_m);
  }
  assert.deepEqual(sent, [0, 1000, 2000, 3000, 4000, 5000]);
});

test('one fix that the browser tells again and again grows old all the same', () => {
  const reporter = asking();
  for (let now_ms = 0; now_ms <= 4000; now_ms += 500) reporter.fix(coords, 0, now_ms, now_ms);
  assert.equal(reporter.why(4000), null);
  assert.equal(reporter.why(4001), 'timeout');
});

test('until the first fix comes it is waited for, and that is sent every three seconds', () => {
  const reporter = asking();
  const sent = [];
  for (let now_ms = 0; now_ms <= 7000; now_ms += 200) if (say(reporter, now_ms) === 'timeout') sent.push(now_ms);
  assert.deepEqual(sent, [0, 3000, 6000]);
});

test('a single failure between fixes is none, a lasting one is sent', () => {
  const reporter = asking();
  reporter.fix(coords, 0, 0, 0);
  say(reporter, 0);
  reporter.fail('unavailable');
  assert.equal(say(reporter, 1000), null);
  reporter.fix(coords, 1500, 1500, 1500);
  assert.ok(say(reporter, 1500).lat_deg);
  reporter.fail('unavailable');
  assert.equal(say(reporter, 5500), null);
  assert.equal(say(reporter, 5501), 'unavailable');
  reporter.fix(coords, 6000, 6000, 6000);
  assert.ok(say(reporter, 6000).lat_deg, 'a fix after a reason waits for nothing');
});

test('a refusal is sent at once, over everything, and forgotten with the next request', () => {
  const reporter = asking();
  reporter.fix(coords, 0, 0, 0);
  say(reporter, 0);
  reporter.fail('denied');
  assert.equal(say(reporter, 100), 'denied');
  reporter.isHidden = true;
  assert.equal(say(reporter, 200), null);
  assert.equal(reporter.why(200), 'denied');
  reporter.isHidden = false;
  reporter.begin(300);
  assert.equal(say(reporter, 300), 'timeout');
});

test('in the background there is no position, whatever came before', () => {
  const reporter = asking();
  reporter.fix(coords, 0, 0, 0);
  reporter.isHidden = true;
  assert.equal(say(reporter, 100), 'hidden');
  reporter.isHidden = false;
  assert.ok(say(reporter, 200).lat_deg);
});

test('a new connection gets it anew, and what was not sent is sent later', () => {
  const reporter = asking();
  reporter.fail('denied');
  assert.equal(say(reporter, 0), 'denied');
  assert.equal(say(reporter, 100), null);
  reporter.forget();
  assert.deepEqual(reporter.due(200), { why: 'denied' });
  assert.deepEqual(reporter.due(300), { why: 'denied' });
});

test('the browser’s three errors', () => {
  assert.deepEqual([1, 2, 3, 99].map(whyOf), ['denied', 'unavailable', 'timeout', 'unavailable']);
});
