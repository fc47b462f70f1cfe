import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Delivery } from '../../static/js/drive/mark-delivery.js';
import { MarkClock } from '../../static/js/drive/mark-clock.js';
import { corrected, headWords, markedAt, moreWords, newMark, outdated, stepOf, storageText, waitWords, waitingOf, waitingWords } from '../../static/js/drive/mark-model.js';
import { courseOf, linePath, xOf } from '../../static/js/drive/mark-plot.js';
import { HELD_MS, PULL_PX, Press } from '../../static/js/drive/press.js';
import { MOST_POINTS, scaled, smallerWords } from '../../static/js/drive/photo.js';
import { rowsOf, storedWords } from '../../static/js/drive/mark-list.js';
import { isForNow, reasonOf } from '../../static/js/drive/mark-server.js';
import { aboutWords, markAt } from '../../static/js/drive/recorded-marks.js';
import { eventsOf, flagPath, markBeside } from '../../static/js/replay/replay-layout.js';
import { cutWords, typeOf } from '../../static/js/drive/voice.js';

const HOUR_MS = 3_600_000;
const AT_MS = Date.UTC(2026, 10, 19, 14, 7, 32, 250);

/** @returns {Storage} */
function storage(mostBytes = Infinity) {
  const kept = new Map();
  return /** @type {any} */ ({
    getItem: (/** @type {string} */ key) => kept.get(key) ?? null,
    setItem: (/** @type {string} */ key, /** @type {string} */ value) => {
      if (value.length > mostBytes) throw new DOMException('full', 'QuotaExceededError');
      kept.set(key, value);
    },
    removeItem: (/** @type {string} */ key) => kept.delete(key),
  });
}

/** @param {string} id @param {Partial<import('../../static/js/drive/mark-model.js').Mark>} [more] @returns {import('../../static/js/drive/mark-model.js').Mark} */
const mark = (id, more = {}) => ({ ...newMark(id, 'car', { at_ms: AT_MS, ahead_ms: 0, source: 'measured' }, AT_MS), ...more });
const part = (more = {}) => ({ blob: new Blob(['abc']), type: 'audio/webm', bytes: 3, length_s: 6.2, note: '', isOpen: false, isStored: false, ...more });

test('a tap has the time of the server, though the clock of the phone is an hour off', () => {
  const clock = new MarkClock(storage());
  clock.note(AT_MS, 1000, AT_MS + HOUR_MS); // the fastest message
  clock.note(AT_MS + 200, 1950, AT_MS + HOUR_MS + 950); // this one was 750 ms under way
  const { at_ms, ahead_ms, source } = clock.at(2000, AT_MS + HOUR_MS + 1000);
  assert.equal(at_ms, AT_MS + 1000);
  assert.equal(ahead_ms, HOUR_MS);
  assert.equal(source, 'measured');
});

test('a phone that slept goes by its wall clock, for only that went on', () => {
  const clock = new MarkClock(null);
  clock.note(AT_MS, 1000, AT_MS + 840);
  assert.equal(clock.at(1500, AT_MS + 840 + 60_500).at_ms, AT_MS + 60_500);
});

test('another visit remembers the difference of the clocks, and a first one reports that it knows none', () => {
  const kept = storage();
  assert.equal(new MarkClock(kept).at(0, AT_MS).source, 'unknown');
  new MarkClock(kept).note(AT_MS, 10, AT_MS - 500);
  const { at_ms, source } = new MarkClock(kept).at(7, AT_MS + 1000);
  assert.deepEqual([at_ms, source], [AT_MS + 1500, 'remembered']);
});

test('a press is a tap before 0.4 s and held after', () => {
  const press = new Press();
  press.down(0, 300);
  assert.equal(press.look(HELD_MS - 1), null);
  assert.equal(press.up(HELD_MS - 1), 'tap');
  press.down(1000, 300);
  assert.equal(press.look(1000 + HELD_MS), 'hold');
  assert.equal(press.look(1001 + HELD_MS), null, 'once');
  assert.equal(press.move(300 - PULL_PX + 1), null);
  assert.equal(press.up(3000), 'keep');
  assert.equal(press.up(3001), null);
});

test('a held press is pulled away to the left, or taken by the browser, and ten taps a second are ten', () => {
  const press = new Press();
  press.down(0, 300);
  assert.equal(press.move(100), null, 'not held yet: a finger that slips is still a tap');
  press.look(HELD_MS);
  assert.equal(press.move(300 - PULL_PX), 'pull');
  press.down(2000, 300);
  press.look(2000 + HELD_MS);
  assert.equal(press.cancel(), 'keep', 'what came is kept');
  press.down(4000, 300);
  assert.equal(press.cancel(), null, 'a scroll is no mark');
  const taps = [...Array(10).keys()].filter((i) => (press.down(5000 + 100 * i, 0), press.up(5030 + 100 * i) === 'tap'));
  assert.equal(taps.length, 10);
});

test('what is to be delivered follows from what is stored', () => {
  assert.equal(stepOf(mark('a')), 'mark');
  assert.equal(stepOf(mark('a', { stored: 1 })), null);
  assert.equal(stepOf(mark('a', { stored: 1, version: 2, voice: part() })), 'change');
  assert.equal(stepOf(mark('a', { stored: 1, voice: part() })), 'voice');
  assert.equal(stepOf(mark('a', { stored: 1, voice: part({ isOpen: true }) })), null);
  assert.equal(stepOf(mark('a', { stored: 1, voice: part({ isStored: true }), photo: part() })), 'photo');
  assert.equal(stepOf(mark('a', { isRemoved: true })), 'drop');
  assert.equal(stepOf(mark('a', { isRemoved: true, isSent: true })), 'remove', 'it may be there although no answer came');
});

/**
 * A server that answers as set.
 * @param {(step: string, id: string) => import('../../static/js/drive/mark-delivery.js').Delivered | Promise<import('../../static/js/drive/mark-delivery.js').Delivered>} tells
 * @param {{vehicle?: () => string, onChange?: () => void}} [more]
 */
function delivery(tells, { vehicle = () => 'car', onChange = () => {} } = {}) {
  /** @type {Map<string, import('../../static/js/drive/mark-model.js').Mark>} */
  const kept = new Map();
  /** @type {string[]} */
  const received = [];
  /** @type {string[]} */
  const takenBack = [];
  /** @type {any[]} */
  const sent = [];
  const tell = (/** @type {string} */ step, /** @type {string} */ id) => {
    received.push(`${step} ${id}`);
    return Promise.resolve(tells(step, id));
  };
  const marks = {
    all: () => kept.values(),
    read: async (/** @type {string} */ id) => kept.get(id) ?? null,
    /** @param {string} id @param {(mark: import('../../static/js/drive/mark-model.js').Mark) => import('../../static/js/drive/mark-model.js').Mark | null} change */
    change: async (id, change) => {
      const changed = change(/** @type {any} */ (kept.get(id)));
      if (changed) kept.set(id, changed);
      else kept.delete(id);
      onChange();
    },
    alone: (/** @type {string} */ _, /** @type {() => Promise<void>} */ act) => act(),
    onTakenBack: (/** @type {string} */ reason) => void takenBack.push(reason),
  };
  const server = { isThere: () => true, vehicle, mark: (/** @type {{mark: string}} */ fields) => { sent.push(fields); return tell('mark', fields.mark); }, remove: (/** @type {string} */ id) => tell('remove', id), upload: (/** @type {string} */ id, /** @type {string} */ _, /** @type {string} */ step) => tell(step, id) };
  let now_ms = 0;
  return { kept, received, sent, takenBack, wait: (/** @type {number} */ ms) => { now_ms += ms; }, it: new Delivery(marks, server, () => now_ms) };
}

const OK = { ok: true, isLost: false, reason: '' };
const LOST = { ok: false, isLost: true, reason: '' };

test('marks are delivered oldest first, then voices and photos, until nothing waits', async () => {
  const { it, kept, received } = delivery(() => OK);
  kept.set('new', mark('new', { wall_ms: AT_MS + 5000 }));
  kept.set('old', mark('old', { voice: part(), photo: part() }));
  kept.set('other', mark('other', { vehicle: 'another car' }));
  await it.look();
  assert.deepEqual(received, ['mark old', 'mark new', 'voice old', 'photo old']);
  assert.equal(kept.get('old')?.voice?.blob, null, 'the server has it');
  assert.deepEqual(waitingOf(kept.values(), 'car'), []);
  assert.equal(stepOf(/** @type {any} */ (kept.get('other'))), 'mark', 'it waits for its own car');
});

test('without an answer it is tried again, seldom, with the same id', async () => {
  let isThere = false;
  const { it, kept, received, wait } = delivery(() => (isThere ? OK : LOST));
  kept.set('a', mark('a'));
  await it.look();
  await it.look();
  assert.deepEqual(received, ['mark a'], 'not at once');
  wait(500);
  await it.look();
  wait(500);
  await it.look();
  assert.equal(received.length, 2, 'ever more seldom');
  isThere = true;
  await it.hurry();
  assert.deepEqual(new Set(received), new Set(['mark a']));
  assert.equal(stepOf(/** @type {any} */ (kept.get('a'))), null);
});

test('one that is refused shows why and keeps no other waiting', async () => {
  const { it, kept, received, wait } = delivery((_, id) => (id === 'bad' ? { ok: false, isLost: false, reason: 'Too many marks.' } : OK));
  kept.set('bad', mark('bad'));
  kept.set('good', mark('good', { wall_ms: AT_MS + 1 }));
  await it.look();
  assert.deepEqual(received, ['mark bad', 'mark good']);
  assert.match(moreWords(/** @type {any} */ (kept.get('bad'))).join(), /not stored: Too many marks/);
  wait(30_001);
  await it.look();
  assert.equal(received.filter((call) => call === 'mark bad').length, 2);
});

test('a photo that cannot be uploaded, or takes long, keeps no mark waiting', async () => {
  /** @type {((reply: import('../../static/js/drive/mark-delivery.js').Delivered) => void) | undefined} */
  let answer;
  const { it, kept, received, wait } = delivery((step) => (step === 'photo' ? new Promise((resolve) => { answer = resolve; }) : OK));
  kept.set('a', mark('a', { stored: 1, photo: part() }));
  const look = it.look();
  await new Promise(setImmediate);
  kept.set('b', mark('b', { wall_ms: AT_MS + 1 }));
  void it.look();
  await new Promise(setImmediate);
  assert.deepEqual(received, ['photo a', 'mark b'], 'while it is under way');
  answer?.(LOST);
  await look;
  kept.set('c', mark('c', { wall_ms: AT_MS + 2, voice: part() }));
  await it.look();
  assert.deepEqual(received, ['photo a', 'mark b', 'mark c'], 'it was lost: parts rest, marks do not');
  wait(500);
  void it.look();
  await new Promise(setImmediate);
  assert.deepEqual(received.slice(3), ['voice c', 'photo a'], 'what was never tried goes first');
});

test('a server without room refuses a photo, which is offered again', async () => {
  assert.ok(isForNow(503) && isForNow(429) && !isForNow(507) && !isForNow(413));
  assert.deepEqual([[404, 'Not Found'], [413, null], [404, 'No such mark.']].map(([status, detail]) => reasonOf(Number(status), detail)), ['This server cannot store it (404).', 'The server refused it (413).', 'No such mark.']);
  const full = { ok: false, isLost: false, reason: 'The disk is full.' };
  const { it, kept, received, wait } = delivery((step) => (step === 'photo' ? full : OK));
  kept.set('a', mark('a', { photo: part() }));
  await it.look();
  assert.match(moreWords(/** @type {any} */ (kept.get('a'))).join(), /not stored: The disk is full/);
  kept.set('a', { .../** @type {any} */ (kept.get('a')), words: 'late', version: 2, voice: part() });
  await it.look();
  assert.deepEqual(received, ['mark a', 'photo a', 'mark a', 'voice a'], 'what else there is of it goes on');
  wait(30_001);
  await it.look();
  assert.equal(received.at(-1), 'photo a');
});

test('a photo that was replaced while it was uploaded is uploaded too', async () => {
  const second = part({ blob: new Blob(['second']), made: 'second' });
  const { it, kept, received } = delivery((step) => {
    if (step === 'photo' && received.length === 2) kept.set('a', { .../** @type {any} */ (kept.get('a')), photo: second });
    return OK;
  });
  kept.set('a', mark('a', { photo: part() }));
  await it.look();
  assert.deepEqual(received, ['mark a', 'photo a', 'photo a']);
  assert.equal(kept.get('a')?.photo?.isStored, true);
});

test('a mark goes to no other car, though another is shown while it is being kept', async () => {
  let vehicle = 'car';
  const { it, kept, received } = delivery(() => OK, { vehicle: () => vehicle, onChange: () => { vehicle = 'another car'; } });
  kept.set('a', mark('a'));
  await it.look();
  assert.deepEqual(received, []);
});

test('a mark that the server does not take back stays, and shows why', async () => {
  const { it, kept, takenBack } = delivery((_, id) => ({ ok: false, isLost: false, reason: id === 'gone' ? 'There is no such mark.' : 'Viewers cannot do this.' }));
  kept.set('a', mark('a', { stored: 1, isSent: true, isRemoved: true }));
  kept.set('gone', mark('gone', { isSent: true, isRemoved: true, wall_ms: AT_MS + 1 }));
  await it.look();
  assert.deepEqual([...kept.keys()], ['a']);
  assert.equal(kept.get('a')?.isRemoved, false);
  assert.match(moreWords(/** @type {any} */ (kept.get('a'))).join(), /not taken back: Viewers cannot do this/);
  assert.deepEqual(takenBack, ['Viewers cannot do this.', '']);
});

test('a mark states how long ago it was, for the server’s clock may have been set meanwhile', async () => {
  const { it, kept, sent } = delivery(() => OK);
  kept.set('a', mark('a', { wall_ms: Date.now() - 90_000, shift_s: -2 }));
  await it.look();
  assert.ok(sent[0].age_ms >= 92_000 && sent[0].age_ms < 122_000, String(sent[0].age_ms));
});

test('what is changed while it is under way is sent again, and what is taken back is removed', async () => {
  const { it, kept, received } = delivery((step) => {
    if (step === 'mark' && received.length === 1) kept.set('a', { ...mark('a'), isSent: true, words: 'late', version: 2 });
    return OK;
  });
  kept.set('a', mark('a'));
  await it.look();
  assert.deepEqual(received, ['mark a', 'mark a']);
  kept.set('a', { .../** @type {any} */ (kept.get('a')), isRemoved: true });
  await it.hurry();
  assert.deepEqual(received.at(-1), 'remove a');
  assert.equal(kept.size, 0);
});

test('a mark from before any answer of a server is corrected later, and old ones are left to the server', () => {
  const late = corrected(mark('a', { wall_ms: AT_MS + HOUR_MS, tap_ms: AT_MS + HOUR_MS, clock: 'unknown' }), HOUR_MS);
  assert.equal(markedAt(late), AT_MS);
  assert.match(moreWords(late).join(), /\+3600\.00 s, corrected/);
  const old = mark('old', { stored: 1 });
  const waits = mark('waits');
  assert.deepEqual(outdated([old, waits], AT_MS + 13 * HOUR_MS), [old]);
});

test('rows say what was cut, moved or made smaller', () => {
  const cut = mark('a', { voice: part({ note: cutWords('hidden', 3.12), length_s: 3.12 }), shift_s: -1.5, category: 'control' });
  assert.match(headWords(cut), /^\d\d:\d\d:\d\d · control$/);
  assert.deepEqual(moreWords(cut), ['voice cut at 3.1 s: the page was hidden', 'moved by −1.5 s']);
  assert.equal(markedAt(cut), AT_MS - 1500);
  const said = (/** @type {any} */ more) => { const one = mark('b', { voice: part({ length_s: 4 }), ...more }); return [headWords(one).slice(11), ...moreWords(one)]; };
  assert.deepEqual(said({}), ['voice', '4.0 s'], 'what the head names is not named again');
  assert.deepEqual(said({ category: 'control' }), ['control', 'voice 4.0 s']);
  assert.deepEqual(said({ photo: part({ bytes: 2.1e6 }) }), ['voice', '4.0 s', 'photo 2.1 MB']);
  assert.deepEqual(said({ voice: null, photo: part({ bytes: 2.1e6 }) }), ['photo', '2.1 MB']);
  assert.equal(cutWords('let go', 3), '');
  assert.equal(smallerWords(11.8e6, 2.1e6), 'photo 2.1 MB, made smaller from 11.8 MB');
  assert.equal(waitWords(3), '3 wait');
  assert.match(waitingWords([mark('a')], false, true).text, /lost if the page is closed/);
  const full = mark('b', { refused: 'No room.' });
  assert.equal(waitingWords([full], true, false).text, 'They survive closing the page. The server refused 1: offered again every 30 s.');
  assert.match(waitingWords([mark('a'), full], true, false).text, /being delivered, oldest first\. The server refused 1:/);
  assert.doesNotMatch(waitingWords([full], true, true).text, /refused/);
});

test('rows of this phone come before those of the server, each mark once', () => {
  const stored = { mark: 'a', marked_ms: AT_MS, category: null, words: '', voice: false, photo: false, source: 'page', by: 'Pixel 7' };
  const rows = rowsOf([mark('a', { words: 'newer here' }), mark('w')], [stored, { ...stored, mark: 'c', source: 'car', by: null, marked_ms: AT_MS + 9000 }]);
  assert.deepEqual(rows.map(({ id, isWaiting }) => [id, isWaiting]), [['a', true], ['w', true], ['c', false]]);
  assert.deepEqual(rows[2]?.more, ['by the car’s button']);
});

test('a mark is stored on this device once it is on its disk, and nothing else is called stored', () => {
  const fresh = mark('a');
  assert.equal(storageText(fresh, false, true), 'being stored');
  assert.equal(storageText(fresh, true, true), 'stored on this device');
  assert.equal(storageText(fresh, false, false), 'until the page closes');
  assert.equal(storageText({ ...fresh, stored: 1, version: 2 }, true, true), 'being stored');
  assert.equal(storageText({ ...fresh, stored: 1 }, false, false), 'stored');
  assert.equal(storageText({ ...fresh, refused: 'Too old.' }, true, true), 'not stored: Too old.');
});

test('a photo has at most two million points and keeps its shape', () => {
  const [width, height] = scaled(8000, 6000);
  assert.ok(width * height <= MOST_POINTS && width * height > 0.99 * MOST_POINTS);
  assert.ok(Math.abs(width / height - 4 / 3) < 0.01);
  assert.deepEqual(scaled(640, 480), [640, 480]);
});

test('voice is recorded as what this browser can, Opus first', () => {
  assert.equal(typeOf(() => true), 'audio/webm;codecs=opus');
  assert.equal(typeOf((type) => type.startsWith('audio/mp4')), 'audio/mp4;codecs=opus');
  assert.equal(typeOf(() => false), '');
});

test('the speed about a mark stands at its seconds, gaps are not bridged, and nothing is nothing', () => {
  const course = courseOf({ times_s: [-30, -10, -9.8, -9.6, -7, -6.8], highest: [1, 4, 4.2, 4.4, 5, null] }, 8, 5.5);
  assert.deepEqual(course?.points.map(({ at_s }) => Math.round(10 * at_s) / 10), [-2, -1.8, -1.6, 1]);
  assert.equal(linePath(course?.points ?? [], () => 0).match(/M/g)?.length, 2);
  assert.equal(course?.limit, 5.5);
  assert.ok(xOf(-12) < xOf(0) && xOf(0) < xOf(12) && xOf(99) === xOf(12));
  assert.equal(courseOf({ times_s: [-30], highest: [1] }, 8, null), null);
});

test('a replay steps through alarms and marks in the order of time, and shows a mark at its moment', () => {
  const alarms = [{ at_s: 5 }, { at_s: 40 }];
  const marks = [{ at_s: 20 }, { at_s: 22 }].map((one) => ({ mark: String(one.at_s), marked_ms: 0, category: 'control', words: '', voice: false, photo: false, source: 'car', by: null, late: true, ...one }));
  assert.deepEqual(eventsOf(alarms, marks).map(({ at_s }) => at_s), [5, 20, 22, 40]);
  assert.equal(markBeside(eventsOf(alarms, marks), 5, 1)?.at_s, 20);
  assert.equal(eventsOf(alarms, []), alarms);
  assert.equal(markAt(marks, 19), null);
  assert.equal(markAt(marks, 20)?.mark, '20');
  assert.equal(markAt(marks, 25)?.mark, '22', 'the last one that has begun');
  assert.equal(markAt(marks, 60), null);
  assert.equal(aboutWords(/** @type {any} */ (marks[0])), 'Control · by the car’s button · delivered after the recording');
  assert.match(flagPath(12.34), /^M12\.3 /);
});

test('the row of a stored mark names each part once', () => {
  const stored = /** @type {any} */ ({ marked_ms: AT_MS, category: null, words: '', voice: true, photo: false, source: 'page', by: 'Ann' });
  const [alone, among] = [storedWords(stored), storedWords({ ...stored, category: 'object', photo: true })];
  assert.match(alone.head, /· voice$/);
  assert.deepEqual(alone.more, ['Ann']);
  assert.match(among.head, /· object$/);
  assert.deepEqual(among.more, ['voice', 'photo', 'Ann']);
});
