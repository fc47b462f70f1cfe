// States for the tests of the pure functions.

/** @returns {any} */
export function state({ session = {}, link = {}, ...more } = {}) {
  return {
    kind: 'state', seq: 1, vehicle: 'car', server: { time_ms: 0, boot: 'a', version: '0', pages: 1, frames_skipped: 0, loop_lag_ms: 0 },
    session: { phase: 'monitoring', address: 'ws://car:9090', name: 'car:9090', ros_version: 1, connected_for_s: 60, paused: false, paused_for_s: 0, track_m: 0, received: 1, rejected: 0, ...session },
    link: { cut: null, since_ms: null, bridge_age_s: 0.1, car_age_s: 0.05, problem: null, attempts: 0, trying_for_s: 0, topics_subscribed: 9, topics_heard: 9, ...link },
    signals: {}, nearest: { time_gap_s: null, stopping_m: null }, checks: [], alarms: [], limits: {},
    recording: { state: 'off', for_s: null }, decelerate: { state: 'not_available', why: 'not configured' }, control: { holder: null }, ...more,
  };
}

/** @returns {any} */
export function alarm(more = {}) {
  return {
    id: 'speed_limit', occurrence: 1, title: 'Speed above limit', priority: 'critical', place: 'dialog', sound: 'high', state: 'UNACKED', active: true,
    needs_ack: true, raised_ms: 0, for_s: 2.3, text: '', trip_text: '', measured: null, limit: null, causes: [], actions: ['acknowledge'], advice: '',
    shelved_until_ms: null, silenced_until_ms: null, silenced_by: null, ...more,
  };
}
