// A voice note of at most 10 s: what the microphone gives, in pieces, so that what came is kept whatever ends it.

import { fixed } from '../core/format.js';

/** The longest [ms]. */
export const LONGEST_MS = 10_000;
/** A piece comes so often: so much at most is lost when the page is killed [ms]. */
const PIECE_MS = 500;
/** A microphone that gives nothing for so long after it was stopped is left alone [ms]. */
const ENDS_MS = 3000;
/** In this order; the first that this browser can record. */
const TYPES = ['audio/webm;codecs=opus', 'audio/mp4;codecs=opus', 'audio/ogg;codecs=opus', 'audio/mp4', 'audio/webm'];

/** @typedef {'let go' | 'full' | 'hidden' | 'microphone' | 'page'} Ending why it ended */

const CUT = { hidden: 'the page was hidden', microphone: 'the microphone was lost', page: 'the page was closed' };

/**
 * The note of a voice that was cut off; '' where it was not.
 * @param {Ending} ending
 * @param {number} length_s
 */
export function cutWords(ending, length_s) {
  const why = ending === 'let go' || ending === 'full' ? '' : CUT[ending];
  return why ? `voice cut at ${fixed(length_s)} s: ${why}` : '';
}

/** Why the microphone cannot be used, in a sentence. @param {unknown} error */
export function refusalWords(error) {
  const name = error instanceof DOMException ? error.name : '';
  if (name === 'NotAllowedError') return 'The microphone was refused. Allow it for this site in the browser to add voice to a mark.';
  if (name === 'NotFoundError') return 'This device has no microphone.';
  if (name === 'NotReadableError') return 'The microphone is used by another program.';
  return 'This browser cannot record voice.';
}

/** @param {(type: string) => boolean} canRecord */
export function typeOf(canRecord) {
  return TYPES.find(canRecord) ?? '';
}

export class Voice {
  /** @type {Blob[]} */
  #pieces = [];
  /** @type {MediaStream | null} */
  #stream = null;
  /** @type {MediaRecorder | null} */
  #recorder = null;
  /** @type {AudioContext | null} */
  #context = null;
  /** @type {AnalyserNode | null} */
  #meter = null;
  #samples = new Float32Array(1024);
  /** @type {Ending | null} */
  #ending = null;
  #began_ms = 0;
  #ended_ms = 0;
  /** @type {() => void} */
  #settle = () => {};
  /** Resolves once it has ended and every piece is there. @type {Promise<Ending>} */
  ended;

  /** @param {() => void} onPiece another piece came, or it ended */
  constructor(onPiece) {
    this.onPiece = onPiece;
    this.ended = new Promise((resolve) => { this.#settle = () => resolve(this.#ending ?? 'let go'); });
  }

  /** Requests the microphone and records. Raises the browser's error where it gives none. */
  async begin() {
    if (!globalThis.MediaRecorder || !navigator.mediaDevices?.getUserMedia) throw new Error('No recorder');
    const stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true, noiseSuppression: true } });
    if (this.#ending) {
      release(stream);
      return this.#settle();
    }
    try {
      this.#record(stream);
    } catch (error) {
      release(stream);
      throw error;
    }
    this.#stream = stream;
    this.#began_ms = performance.now();
    this.#listen(stream);
  }

  /** Raises the browser's error where it cannot. @param {MediaStream} stream */
  #record(stream) {
    const type = typeOf((one) => MediaRecorder.isTypeSupported(one));
    const recorder = new MediaRecorder(stream, { ...(type ? { mimeType: type } : {}), audioBitsPerSecond: 32_000 });
    recorder.ondataavailable = ({ data }) => {
      if (data.size) this.#pieces.push(data);
      this.onPiece();
    };
    recorder.onstop = () => this.#stopped();
    recorder.onerror = () => this.end('microphone');
    for (const track of stream.getTracks()) track.onended = () => this.end('microphone');
    recorder.start(PIECE_MS);
    this.#recorder = recorder;
  }

  /** @param {Ending} ending */
  end(ending) {
    if (this.#ending) return;
    this.#ending = ending;
    this.#ended_ms = performance.now();
    const recorder = this.#recorder;
    if (!recorder) return this.#settle();
    if (recorder.state === 'inactive') return this.#stopped();
    setTimeout(() => this.#stopped(), ENDS_MS);
    recorder.stop();
  }

  get isRecording() {
    return this.#began_ms > 0 && this.#ending === null;
  }

  /** So long was spoken [ms]. */
  get length_ms() {
    return this.#began_ms === 0 ? 0 : Math.min(LONGEST_MS, (this.#ending ? this.#ended_ms : performance.now()) - this.#began_ms);
  }

  /** What came; null: nothing. */
  get blob() {
    return this.#pieces.length ? new Blob(this.#pieces, { type: this.type }) : null;
  }

  /** Its type without what the browser adds to it. */
  get type() {
    return (this.#recorder?.mimeType || 'audio/webm').split(';')[0] ?? 'audio/webm';
  }

  /** How loud it is now, 0 … 1. */
  get level() {
    if (!this.#meter) return 0;
    this.#meter.getFloatTimeDomainData(this.#samples);
    let sum = 0;
    for (const sample of this.#samples) sum += sample * sample;
    return Math.min(1, 4 * Math.sqrt(sum / this.#samples.length));
  }

  /** @param {MediaStream} stream */
  #listen(stream) {
    try {
      this.#context = new AudioContext();
      this.#meter = this.#context.createAnalyser();
      this.#meter.fftSize = this.#samples.length;
      this.#context.createMediaStreamSource(stream).connect(this.#meter);
    } catch {
      this.#meter = null; // it is recorded without a level
    }
  }

  #stopped() {
    this.#ending ??= 'microphone';
    if (this.#stream) release(this.#stream);
    this.#stream = null;
    void this.#context?.close().catch(() => {});
    this.#context = this.#meter = null;
    this.#settle();
  }
}

/** @param {MediaStream} stream */
function release(stream) {
  for (const track of stream.getTracks()) {
    track.onended = null;
    track.stop();
  }
}
