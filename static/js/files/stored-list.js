// What is in the store of a server that has no recordings of its own, as a list of recordings. Pure functions, no DOM.

/**
 * @typedef {import('./files-layout.js').Recording} Recording
 * @typedef {import('./files-layout.js').Listing} Listing
 * @typedef {import('./files-layout.js').Choice} Choice
 * @typedef {import('../core/protocol-types.js').StoredList} StoredList
 * @typedef {Recording & {of: StoredList['recordings'][number]}} StoredRow
 */

const MOST = 100; // rows of the store a request

/** @param {string | null} cursor @param {number} limit @param {Choice} choice @param {string} [vehicle] only of this car */
export function storedQueryOf(cursor, limit, choice, vehicle = '') {
  const query = new URLSearchParams({ limit: String(Math.min(MOST, limit)) });
  if (cursor) query.set('cursor', cursor);
  if (vehicle || choice.kind === 'vehicle') query.set('vehicle', vehicle || choice.value);
  return query.toString();
}

/**
 * What is in the store, as the list of a server's own recordings.
 * @param {StoredList} stored
 * @param {string | null} why why it is not the list of the car's agent, as a sentence
 * @returns {Listing}
 */
export function listingOf(stored, why) {
  const total = { count: stored.count, bytes: 0 };
  return { recordings: stored.recordings.map(rowOf), next: stored.next, found: total, all: total, trash: { count: 0, bytes: 0 }, free_bytes: null, waiting: 0, formats: [], vehicles: [], tags: [], store: { address: stored.store, problem: why } };
}

/** @param {StoredList['recordings'][number]} of @returns {StoredRow} */
function rowOf(of) {
  return {
    of, id: of.id, vehicle: of.vehicle, session: null, part: null, started_ms: of.started_ms, length_s: of.length_s, size_bytes: of.size_bytes ?? NaN, distance_m: of.distance_m, top_speed_mps: of.top_speed_mps,
    alarms: of.alarms, marks: 0, late: '', title: of.title, note: '', weather: '', tags: [], state: 'read', problem: null, damage: [], unread: [], left_out: [], left_out_count: 0, not_received: [], not_received_count: 0, ros_version: null, ended: null, ended_why: null,
    is_clip: false, clip_of: null, file: of.file ?? '', format: 'mcap', several_files: null, sha256: of.sha256, head: null, verified: null, thumbnail: '', sketch: of.sketch, trashed_ms: null,
    stored: { state: of.file === null ? 'none' : 'stored', share: null, checked_ms: of.checked_ms, sentence: '', clips: of.clips.length, is_asked: false, is_deletion_asked: false },
  };
}
