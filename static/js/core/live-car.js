// The live car of a frame, also while the page shows a recording.

/** @typedef {import('./protocol-types.js').State} State */

/** The frame whose alarms must be announced; null: there is none. @param {State | null} frame @returns {State | null} */
export function liveOf(frame) {
  if (!frame?.replay) return frame;
  const { live } = frame;
  const decelerate = live?.decelerate ?? { state: 'not_available', why: null };
  return live ? { ...frame, alarms: live.alarms, recording: live.recording, decelerate, session: { ...frame.session, phase: live.phase, paused: live.paused } } : null;
}

/** What is signed with an order to the live car. @param {State | null} frame */
export function challengeOf(frame) {
  return frame?.replay ? frame.live?.challenge : frame?.server.challenge;
}

/** Who is in control. @param {State | null} frame */
export function controlOf(frame) {
  return (frame?.replay ? frame.live?.control : frame?.control) ?? null;
}

/**
 * The number of the lease by which a page is in control; null: it is not.
 * @param {ReturnType<typeof controlOf>} control as the newest frame has it
 * @param {string} page by which the server knows the page
 * @param {number | null} granted as an answer stated, until the frames have it
 */
export function fenceOf(control, page, granted) {
  const known = control?.page === page && page ? (control.fence ?? null) : null;
  return granted !== null && (control?.fence ?? 0) < granted ? granted : known;
}
