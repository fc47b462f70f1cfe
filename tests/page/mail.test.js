// The texts of mail: addresses, sizes, states, and the link for the phone's own mail program.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { aboutOf, keysOf, mailtoOf, pathOf, recipientProblem, recipientsOf, refusedOf, sizeNote, stateOf } from '../../static/js/files/mail-layout.js';

const NOW_MS = new Date(2026, 8, 21, 14, 0, 0).getTime();

/** @param {object} [more] @returns {any} */
function mail(more = {}) {
  return {
    n: 1, ordered_ms: NOW_MS, recordings: ['car_1'], format: 'mcap', to: ['ann@example.org'], subject: 'Drive', state: 'queued', said: '', is_ready: true,
    share: null, way: 'attached', size_bytes: 4_200_000, parts: [part()], ...more,
  };
}

/** @param {object} [more] @returns {any} */
function part(more = {}) {
  return { part: 1, parts: 1, state: 'queued', said: '', attempts: 0, next_ms: 0, recipients: [], ...more };
}

test('addresses are taken apart at commas, semicolons, blanks and lines, each once', () => {
  assert.deepEqual(recipientsOf(' a@b, c@d;e@f\n a@b  g@h '), ['a@b', 'c@d', 'e@f', 'g@h']);
  assert.deepEqual(recipientsOf('  '), []);
});

for (const [addresses, problem] of /** @type {[string[], RegExp | null][]} */ ([
  [[], /Enter a recipient/], [['a@b'], null], [['a'], /“a” is not an address/], [['a@b', 'a@b@c'], /a@b@c/], [Array.from({ length: 21 }, (_, i) => `a${i}@b`), /at most 20/], [['x'.repeat(99)], /^“x{60}”/],
])) {
  test(`what is plainly wrong with ${addresses.length} addresses`, () => {
    const found = recipientProblem(addresses);
    if (problem === null) assert.equal(found, null);
    else assert.match(found ?? '', problem);
  });
}

test('the size decides how it is sent', () => {
  assert.equal(sizeNote(4_200_000, 18, 'split'), '4.2 MB as recorded, compressed: one mail.');
  assert.match(sizeNote(18_000_001, 18, 'split'), /Above 18.0 MB it is sent as several mails, with a sentence on how to join them\.$/);
  assert.match(sizeNote(60_000_000, 18, 'link'), /^60.0 MB as recorded.*a link to this server\.$/);
  assert.match(sizeNote(null, 18, 'link'), /^It is compressed\. Above 18.0 MB it is sent as a link/);
});

for (const [name, given, label, detail] of /** @type {[string, object, string, string | RegExp][]} */ ([
  ['being made', { is_ready: false, share: 0.42 }, 'Preparing 42 %', ''],
  ['not begun', { is_ready: false }, 'Preparing', ''],
  ['due', {}, 'Queued', ''],
  ['tried in vain', { said: 'smtp:25 refuses the connection', parts: [part({ next_ms: NOW_MS + 61_000 })] }, 'Waiting', 'smtp:25 refuses the connection. Tried again at 14:01:01.'],
  ['under way', { state: 'sending', share: 0.5, parts: [part({ state: 'sent' }), part({ state: 'sending' })] }, 'Sending 50 %', '1 of 2 parts sent.'],
  ['there', { state: 'sent', said: '250 OK', parts: [part({ state: 'sent' })] }, 'Sent', '250 OK.'],
  ['there in parts', { state: 'sent', parts: [part({ state: 'sent' }), part({ state: 'sent' })] }, 'Sent', '2 parts. '],
  ['refused', { state: 'failed', said: '550 no.', parts: [part({ state: 'failed' })] }, 'Failed', '550 no.'],
  ['cancelled', { state: 'cancelled' }, 'Cancelled', ''],
])) {
  test(`the state of a mail that is ${name}`, () => {
    const found = stateOf(mail(given), NOW_MS);
    assert.equal(found.label, label);
    assert.equal(found.detail, detail);
    assert.equal(found.isBad, name === 'refused');
  });
}

test('each state has the keys that do something', () => {
  assert.deepEqual(keysOf(mail()), { cancel: 'Cancel', resend: null });
  assert.deepEqual(keysOf(mail({ said: '450 later' })), { cancel: 'Cancel', resend: 'Try now' });
  assert.deepEqual(keysOf(mail({ is_ready: false, said: 'x' })), { cancel: 'Cancel', resend: null });
  assert.deepEqual(keysOf(mail({ state: 'sending' })), { cancel: 'Cancel', resend: null });
  assert.deepEqual(keysOf(mail({ state: 'failed' })), { cancel: 'Give up', resend: 'Send again' });
  assert.deepEqual(keysOf(mail({ state: 'sent' })), { cancel: null, resend: 'Send again' });
  assert.deepEqual(keysOf(mail({ state: 'cancelled' })), { cancel: null, resend: 'Send again' });
});

test('one line names what it is', () => {
  assert.equal(aboutOf(mail()), 'car_1 · MCAP · 4.2 MB');
  assert.equal(aboutOf(mail({ recordings: ['a', 'b'], format: 'html', way: 'link', size_bytes: null })), '2 recordings · Report · as a link');
  assert.equal(aboutOf(mail({ way: 'split', parts: [part(), part()] })), 'car_1 · MCAP · 4.2 MB · 2 parts');
});

test('who is refused is named where the reply does not name them already', () => {
  const refused = [{ address: 'b@x', state: 'refused', said: '550 no' }, { address: 'a@x', state: 'accepted', said: '' }];
  assert.deepEqual(refusedOf(mail({ to: ['a@x', 'b@x'], parts: [part({ recipients: refused }), part({ recipients: refused })] })), ['b@x: 550 no']);
  assert.deepEqual(refusedOf(mail({ to: ['a@x', 'b@x'], said: 'b@x: 550 no; 1 of 2', parts: [part({ recipients: refused })] })), []);
  assert.deepEqual(refusedOf(mail({ to: ['b@x'], parts: [part({ recipients: refused })] })), []);
});

test('the link for a mail program holds all of it and nothing breaks out', () => {
  const link = mailtoOf({ to: ['a+b@x', 'c?cc=evil@y'], subject: 'A & B?', text: 'one\ntwo', links: ['http://h/1'] });
  assert.equal(link, 'mailto:a%2Bb@x,c%3Fcc%3Devil@y?subject=A%20%26%20B%3F&body=one%0D%0Atwo%0D%0A%0D%0Ahttp%3A%2F%2Fh%2F1%0D%0A');
  const long = mailtoOf({ to: ['a@x'], subject: 's', text: 'ä'.repeat(5000), links: ['http://h/1'] });
  assert.ok(long.length <= 1900);
  assert.ok(long.endsWith('http%3A%2F%2Fh%2F1%0D%0A'), 'the link stays');
});

test('where a recording lies', () => {
  assert.equal(pathOf('car_1', 'mcap'), '/api/recordings/car_1/file.mcap');
  assert.equal(pathOf('a/b', 'csv'), '/api/recordings/a%2Fb/export/csv');
});
