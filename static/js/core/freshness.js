// How much ink a value deserves: the server's verdict, degraded by the page's own silence.

/** Frames come at least every 0.25 s; more than two of them missing is silence of our own, not the rhythm of frames. */
export const LAG_GRACE_S = 0.6;

/**
 * @typedef {import('./protocol-types.js').SignalState<any>} Signal
 * @typedef {import('./protocol-types.js').SignalFreshness} Freshness
 * @typedef {import('./protocol-types.js').Question} Question
 * @typedef {Freshness | 'not_chosen' | 'not_in_unit'} Ink not_chosen: the topic of the signal is still to be chosen; not_in_unit: its unit is
 */

/**
 * The state of a signal at the glass.
 * @param {Signal | undefined} signal as the newest frame has it; undefined where the server does not know it
 * @param {number} lag_s age of that frame at the glass: its way here and the silence since [s]
 * @returns {{ink: Freshness, age_s: number | null}}
 */
export function freshnessStyle(signal, lag_s) {
  if (!signal) return { ink: 'not_published', age_s: null };
  const age_s = signal.age_s === null ? null : signal.age_s + lag_s;
  if (age_s === null) return { ink: signal.freshness, age_s };
  if (signal.freshness === 'stale') return { ink: 'stale', age_s };
  if (lag_s <= LAG_GRACE_S) return { ink: signal.freshness, age_s };
  return { ink: age_s > (signal.horizon_s ?? 1) ? 'stale' : 'ageing', age_s };
}

/**
 * The same of a signal of which a question stands: a value that is missing is not missing by the car.
 * @param {{ink: Freshness, age_s: number | null}} state
 * @param {string} signal
 * @param {Question[] | undefined} questions that stand
 * @returns {{ink: Ink, age_s: number | null}}
 */
export function withQuestion(state, signal, questions) {
  if (state.age_s !== null) return state;
  const question = questions?.find((one) => one.signal === signal);
  if (!question) return state;
  return { ink: question.kind === 'source' ? 'not_chosen' : 'not_in_unit', age_s: null };
}
