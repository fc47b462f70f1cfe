// The alarm sounds in the manner of IEC 60601-1-8, as numbers: when each pulse stands, and the samples of a burst.

/**
 * @typedef {import('../core/protocol-types.js').Sound} SoundName
 * @typedef {{at_s: number, for_s: number, hz: number}} Pulse
 * @typedef {{pulses: Pulse[], every_s: number, gain: number, vibration: number[]}} Burst
 */

// Notes with their harmonics lie between 300 and 4000 Hz, where a small loudspeaker is loud and hearing is sensitive.
const C5 = 523.25, E4 = 329.63, G4 = 392, A4 = 440, A5 = 880;

/** @type {Record<'high' | 'medium' | 'low' | 'count', Burst>} */
const BURSTS = {
  // Ten pulses, 3-2 and again 3-2 after a longer rest.
  high: {
    pulses: [0, 0.2, 0.4, 0.8, 1, 1.64, 1.84, 2.04, 2.44, 2.64].map((at_s, i) => ({
      at_s, for_s: 0.14, hz: /** @type {number} */ ([C5, C5, C5, A4, C5][i % 5]),
    })),
    every_s: 5, gain: 0.9, vibration: [140, 60, 140, 60, 140, 260, 140, 60, 140],
  },
  medium: {
    pulses: [0, 0.4, 0.8].map((at_s, i) => ({ at_s, for_s: 0.2, hz: /** @type {number} */ ([E4, G4, A4][i]) })),
    every_s: 10, gain: 0.6, vibration: [200, 200, 200],
  },
  low: {
    pulses: [0, 0.35].map((at_s, i) => ({ at_s, for_s: 0.2, hz: /** @type {number} */ ([A4, E4][i]) })),
    every_s: 20, gain: 0.4, vibration: [],
  },
  // The count-down: even ticks, four a second, above every alarm's note, so that it is taken for none.
  count: { pulses: [{ at_s: 0, for_s: 0.1, hz: A5 }, { at_s: 0.25, for_s: 0.1, hz: A5 }], every_s: 0.5, gain: 0.9, vibration: [90, 160, 90] },
};

/**
 * @param {'high' | 'medium' | 'low' | 'count'} sound
 * @returns {Burst}
 */
export function burstOf(sound) {
  return BURSTS[sound];
}

/** Share of each harmonic, the note itself first: at least four within 15 dB of the loudest, so that it can be located. */
const HARMONICS = [1, 0.6, 0.5, 0.4, 0.3];

/**
 * One burst and the rest until the next, to be played in a loop: it goes on sounding when the page's script hangs.
 * @param {'high' | 'medium' | 'low' | 'count'} sound
 * @param {number} rate_hz samples a second
 * @returns {Float32Array<ArrayBuffer>} −1…1
 */
export function samplesOf(sound, rate_hz) {
  const { pulses, every_s, gain } = burstOf(sound);
  const samples = new Float32Array(Math.round(every_s * rate_hz));
  const loudest = HARMONICS.reduce((sum, share) => sum + share, 0);
  for (const { at_s, for_s, hz } of pulses) {
    const from = Math.round(at_s * rate_hz);
    const count = Math.round(for_s * rate_hz);
    for (let i = 0; i < count; i += 1) {
      const phase = (2 * Math.PI * hz * i) / rate_hz;
      const tone = HARMONICS.reduce((sum, share, k) => sum + share * Math.sin((k + 1) * phase), 0) / loudest;
      samples[from + i] = gain * tone * envelope(i / count);
    }
  }
  return samples;
}

/** Rises and falls over a fifth of the pulse, so that nothing clicks. @param {number} share 0…1 of the pulse */
function envelope(share) {
  return Math.min(1, share / 0.2, (1 - share) / 0.2);
}
