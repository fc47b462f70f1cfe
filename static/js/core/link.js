// The state of the chain phone – server – bridge – car, and its texts: pure functions, no DOM.

import { age, timeOfDay } from './format.js';
import { isWeak } from './round-trip.js';

/**
 * @typedef {import('./protocol-types.js').State} State
 * @typedef {{name: string, mark: string, isBad: boolean, isKnown: boolean}} Node
 *
 * @typedef {object} ChainView
 * @property {'Live' | 'Silent' | 'Lost' | 'Dialling' | 'Waiting' | 'Waking' | 'Replay'} state
 * @property {number | null} age_s age of what is beyond the cut, or of the car's newest message
 * @property {0 | 1 | 2 | null} cut the broken wire: after the phone, the server or the bridge
 * @property {number | null} since_ms wall clock: when what is beyond the cut was last received
 * @property {number} [known] the last node of which anything is known, where no wire is broken and it is not the car
 * @property {Node[]} nodes phone, server, bridge, car
 * @property {string} sentence what fell silent
 * @property {string} detail what is known beside it
 * @property {boolean} [isWeak] the radio between phone and server takes long for an answer
 * @property {boolean} [isUnserved] the server answers, and has nothing of the car
 */

/** A car that has sent nothing for so long after the bridge answered is called silent [s]. */
const FIRST_MESSAGE_S = 2;
const NAMES = ['This device', 'Server', 'Bridge', 'Car'];
const BY_AGENT = ['This device', 'Server', 'Agent', 'Car'];

/**
 * The chain as the page sees it now.
 * @param {object} seen
 * @param {State | null} seen.frame the newest fresh state
 * @param {boolean} seen.isSilent nothing fresh came from the server for 2 s, or never
 * @param {number} seen.silence_s for how long [s]
 * @param {number} seen.lag_s age of the frame at the glass [s]
 * @param {number | null} seen.heard_ms wall clock of the last fresh frame
 * @param {import('./round-trip.js').RoundTrip | null} [seen.trip] between phone and server
 * @param {string} [seen.unserved] why nothing comes from the car's agent although the server answers
 * @returns {ChainView}
 */
export function chainOf({ trip = null, ...seen }) {
  const view = viewOf(seen);
  if (!trip || !isWeak(trip)) return view;
  return { ...view, isWeak: true, detail: `${view.detail} Weak radio: an answer takes ${age(trip.mean_ms / 1000)} s.`.trim() };
}

/** @param {Omit<Parameters<typeof chainOf>[0], 'trip'>} seen @returns {ChainView} */
function viewOf({ frame, isSilent, silence_s, lag_s, heard_ms, unserved = '' }) {
  if (isSilent && frame && silence_s <= 2) return waking(silence_s);
  if (isSilent && unserved) return agentSilent(unserved, silence_s, heard_ms);
  if (isSilent || !frame) return serverSilent(silence_s, heard_ms);
  const { session, link } = frame;
  if (frame.replay) return { state: 'Replay', age_s: frame.replay.silent_s, cut: null, since_ms: null, nodes: nodesOf(null, []), sentence: 'A recording is shown.', detail: '' };
  const bridge_s = older(link.bridge_age_s, lag_s);
  const car_s = older(link.car_age_s, lag_s);
  if (session.phase === 'connecting' || session.phase === 'failed') {
    return {
      state: 'Dialling', age_s: link.trying_for_s + lag_s, cut: 1, since_ms: null,
      nodes: nodesOf(1, ['here', 'answers', link.problem?.mark ?? 'connecting', 'unknown']),
      sentence: link.problem?.title ?? 'Connecting to the bridge.',
      detail: link.problem?.hint ?? '',
    };
  }
  if (session.phase === 'lost' || link.cut === 'server-bridge') {
    return {
      state: 'Lost', age_s: bridge_s, cut: 1, since_ms: link.since_ms,
      nodes: nodesOf(1, ['here', `${age(lag_s)} s`, bridge_s === null ? 'silent' : `silent ${age(bridge_s)} s`, 'unknown']),
      sentence: link.problem?.title ?? 'The bridge stopped answering.',
      detail: link.problem?.hint ?? '',
    };
  }
  const live = ['here', `${age(lag_s)} s`, bridge_s === null ? 'answers' : `${age(bridge_s)} s`];
  const silent_s = car_s ?? older(session.connected_for_s, lag_s);
  if (link.cut === 'bridge-car' || (car_s === null && (silent_s ?? 0) > FIRST_MESSAGE_S)) {
    return {
      state: 'Silent', age_s: silent_s, cut: 2, since_ms: link.since_ms,
      nodes: nodesOf(2, [...live, silent_s === null ? 'silent' : `silent ${age(silent_s)} s`]),
      sentence: link.problem?.title ?? 'The car fell silent.',
      detail: link.problem?.hint ?? 'Server and bridge answer.',
    };
  }
  if (car_s === null) {
    return {
      state: 'Waiting', age_s: older(session.connected_for_s, lag_s), cut: null, since_ms: null, known: 2,
      nodes: nodesOf(null, [...live, 'no message yet'], NAMES, 2),
      sentence: link.problem?.title ?? 'Nothing received yet.',
      detail: link.problem?.hint ?? '',
    };
  }
  return {
    state: 'Live', age_s: car_s, cut: null, since_ms: null,
    nodes: nodesOf(null, [...live, link.problem?.mark ?? `${age(car_s)} s`]),
    sentence: link.problem?.title ?? 'Every part of the chain answers.',
    detail: link.problem?.hint ?? '',
  };
}

/**
 * The page was away: frames may come again, but not yet enough of them to be believed.
 * @param {number} silence_s
 * @returns {ChainView}
 */
function waking(silence_s) {
  return {
    state: 'Waking', age_s: silence_s, cut: null, since_ms: null, known: 0,
    nodes: nodesOf(null, ['here'], NAMES, 0),
    sentence: 'This page was away.', detail: 'Values return with the next data.',
  };
}

/**
 * @param {number} silence_s
 * @param {number | null} heard_ms
 * @returns {ChainView}
 */
function serverSilent(silence_s, heard_ms) {
  const wasHeard = heard_ms !== null;
  return {
    state: 'Lost', age_s: wasHeard ? silence_s : null, cut: 0, since_ms: heard_ms,
    nodes: nodesOf(0, ['here', wasHeard ? `silent ${age(silence_s)} s` : 'no answer', 'unknown', 'unknown']),
    sentence: wasHeard ? 'The server fell silent.' : 'The server does not answer.',
    detail: wasHeard ? `Last data at ${timeOfDay(heard_ms)}. This page keeps trying.` : 'This page keeps trying.',
  };
}

/**
 * The server answers, and has nothing of the car: its agent, or the broker between, is lost.
 * @param {string} why
 * @param {number} silence_s
 * @param {number | null} heard_ms
 * @returns {ChainView}
 */
function agentSilent(why, silence_s, heard_ms) {
  const wasHeard = heard_ms !== null;
  return {
    state: 'Lost', age_s: wasHeard ? silence_s : null, cut: 1, since_ms: heard_ms, isUnserved: true,
    nodes: nodesOf(1, ['here', 'answers', wasHeard ? `silent ${age(silence_s)} s` : 'no answer', 'unknown'], BY_AGENT),
    sentence: why,
    detail: wasHeard ? `Last data at ${timeOfDay(heard_ms)}. The server answers.` : 'The server answers.',
  };
}

/**
 * @param {0 | 1 | 2 | null} cut
 * @param {string[]} marks
 * @param {string[]} [names]
 * @param {number} [known] the last of which anything is known
 * @returns {Node[]}
 */
function nodesOf(cut, marks, names = NAMES, known = cut ?? 3) {
  return names.map((name, i) => ({
    name, mark: marks[i] ?? '', isBad: cut !== null && i === cut + 1, isKnown: i <= known,
  }));
}

/**
 * @param {number | null} age_s
 * @param {number} lag_s
 */
function older(age_s, lag_s) {
  return age_s === null ? null : age_s + lag_s;
}
