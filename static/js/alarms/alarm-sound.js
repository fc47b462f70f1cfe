// Makes the alarm sounds and the vibration; knows whether the phone lets it.

import { burstOf, samplesOf } from './sound-layout.js';

/** @typedef {'high' | 'medium' | 'low' | 'count'} Loud count: of a slow-down that is about to begin by itself */

export class AlarmSound {
  /** @type {AudioContext | null} */
  #context = null;
  /** @type {AudioScheduledSourceNode | null} */
  #source = null;
  /** @type {Loud | null} */
  #sound = null;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #shake;

  /** Can this browser sound at all? */
  get isPossible() {
    return typeof AudioContext === 'function';
  }

  /** Did the phone itself take the sound away, as an iPhone does for a call? */
  get isInterrupted() {
    return /** @type {string | undefined} */ (this.#context?.state) === 'interrupted';
  }

  /** Whether an alarm would sound now. */
  get isRunning() {
    return this.#context?.state === 'running';
  }

  /** Called within a tap: browsers sound only after one. Never waits for the answer, which some never give. */
  arm() {
    if (!this.isPossible) return;
    // On an iPhone the silent switch mutes a page's sound unless the page declares it as playback (Safari 16.4 on).
    const { audioSession } = /** @type {{audioSession?: {type: string}}} */ (/** @type {unknown} */ (navigator));
    if (audioSession) audioSession.type = 'playback';
    this.#context ??= new AudioContext({ latencyHint: 'interactive' });
    if (this.#context.state !== 'running') this.#context.resume().catch(() => {});
  }

  /**
   * Sound this from now on, or be still.
   * @param {import('../core/protocol-types.js').Sound | 'count' | null} name
   */
  say(name) {
    const sound = name === 'none' ? null : name;
    if (sound === this.#sound && (sound === null || this.#source || !this.isRunning)) return;
    const isNew = sound !== this.#sound;
    this.#sound = sound;
    this.#hush();
    if (sound === null) return;
    if (isNew || this.#shake === undefined) this.#vibrate(sound);
    if (!this.#context || !this.isRunning) return;
    try {
      this.#play(this.#context, sound);
    } catch (error) {
      this.#beep(this.#context); // throws where nothing can sound here: the page then counts as one that fails
      console.warn('The alarm sounds as a plain tone:', error);
    }
  }

  /**
   * One burst, within a tap, to hear whether this phone sounds. An alarm that comes meanwhile takes its place.
   * @param {Loud} sound
   * @returns {Promise<'sounding' | 'missing' | 'blocked' | 'busy'>} busy: an alarm sounds
   */
  async test(sound) {
    if (!this.isPossible) return 'missing';
    if (this.#sound !== null) return 'busy';
    this.arm();
    const until_ms = performance.now() + 1000;
    while (!this.isRunning && performance.now() < until_ms) await new Promise((resolve) => { setTimeout(resolve, 50); });
    if (!this.#context || !this.isRunning) return 'blocked';
    if (this.#sound !== null) return 'busy';
    this.#hush();
    this.#play(this.#context, sound, false);
    const { vibration } = burstOf(sound);
    if (vibration.length && typeof navigator.vibrate === 'function') navigator.vibrate(vibration);
    return 'sounding';
  }

  /** What sounds now, audible or not. */
  get saying() {
    return this.#sound;
  }

  /**
   * @param {AudioContext} context
   * @param {Loud} sound
   * @param {boolean} [isAgain] over and over, until it is hushed
   */
  #play(context, sound, isAgain = sound !== 'low') {
    const samples = samplesOf(sound, context.sampleRate);
    const buffer = context.createBuffer(1, samples.length, context.sampleRate);
    buffer.copyToChannel(samples, 0);
    const source = context.createBufferSource();
    source.buffer = buffer;
    source.loop = isAgain;
    source.connect(context.destination);
    source.start();
    this.#source = source;
  }

  /** The plainest sound there is: one tone without an end. @param {AudioContext} context */
  #beep(context) {
    const tone = context.createOscillator();
    tone.connect(context.destination);
    tone.start();
    this.#source = tone;
  }

  /** @param {Loud} sound */
  #vibrate(sound) {
    const { vibration, every_s } = burstOf(sound);
    // Browsers block vibration before a touch; the sound is blocked too then, and the page shows that.
    if (!vibration.length || typeof navigator.vibrate !== 'function' || !navigator.userActivation?.hasBeenActive) return;
    navigator.vibrate(vibration);
    this.#shake = setInterval(() => navigator.vibrate(vibration), every_s * 1000);
  }

  #hush() {
    this.#source?.stop();
    this.#source?.disconnect();
    this.#source = null;
    if (this.#shake === undefined) return;
    clearInterval(this.#shake);
    this.#shake = undefined;
    navigator.vibrate(0);
  }
}
