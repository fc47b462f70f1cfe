import assert from 'node:assert/strict';
import { test } from 'node:test';
import { MarkKey } from '../../static/js/drive/mark-key.js';
import { HELD_MS } from '../../static/js/drive/press.js';
import { Voice } from '../../static/js/drive/voice.js';

/** A microphone that reports when it is released, and a recorder of this browser. @param {any} Recorder */
function microphone(Recorder) {
  let isOpen = false;
  const track = { onended: null, stop: () => { isOpen = false; } };
  const getUserMedia = async () => {
    isOpen = true;
    return { getTracks: () => [track] };
  };
  Object.defineProperty(globalThis, 'navigator', { value: { mediaDevices: { getUserMedia } }, configurable: true });
  Object.assign(globalThis, { MediaRecorder: Recorder });
  return { get isOpen() { return isOpen; } };
}

class Recorder {
  static isTypeSupported() {
    return true;
  }

  state = 'inactive';
  mimeType = 'audio/webm';

  start() {
    this.state = 'recording';
  }

  stop() {} // slow: its last piece has not come yet
}

for (const [name, One] of Object.entries({
  made: class extends Recorder { constructor() { super(); throw new DOMException('', 'NotSupportedError'); } },
  started: class extends Recorder { start() { throw new DOMException('', 'NotSupportedError'); } },
})) {
  test(`a recorder that cannot be ${name} lets the microphone go`, async () => {
    const mic = microphone(One);
    const voice = new Voice(() => {});
    await assert.rejects(voice.begin(), { name: 'NotSupportedError' });
    assert.equal(mic.isOpen, false);
    voice.end('let go');
    assert.equal(await voice.ended, 'let go');
  });
}

test('a tap marks while the recorder of the voice before is still ending', async (context) => {
  context.mock.timers.enable({ apis: ['setInterval', 'setTimeout'] });
  let now_ms = 0;
  context.mock.method(performance, 'now', () => now_ms);
  microphone(Recorder);
  const key = Object.assign(new EventTarget(), { getAttribute: () => null, setAttribute() {}, removeAttribute() {}, hasAttribute: () => false, setPointerCapture() {} });
  Object.assign(globalThis, { document: new EventTarget(), window: new EventTarget() });
  let count = 0;
  const marks = { place: () => ({ id: String((count += 1)) }), get: () => null, change: async () => {}, attach: async () => {} };
  const fresh = { show() {}, listen() {}, voiceEnded() {} };
  const it = new MarkKey(/** @type {any} */ (key), /** @type {any} */ (marks), () => {}, /** @type {any} */ (fresh));
  const send = (/** @type {string} */ type) => key.dispatchEvent(Object.assign(new Event(type), { button: 0, pointerId: 1, clientX: 0 }));
  send('pointerdown');
  now_ms = HELD_MS;
  context.mock.timers.tick(50);
  await new Promise(setImmediate);
  assert.equal(count, 1, 'held');
  now_ms += 2000;
  send('pointerup');
  now_ms += 100;
  send('pointerdown');
  now_ms += 50;
  send('pointerup');
  assert.equal(count, 2);
  it.stop();
});
