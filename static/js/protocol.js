// The shapes of docs/protocol.md as types, and the one place that looks at what came off the socket.

/**
 * @typedef {'fresh' | 'ageing' | 'stale' | 'never' | 'not_published'} Freshness
 * @typedef {'ok' | 'fault' | 'unknown'} Verdict
 * @typedef {'critical' | 'warning' | 'advisory'} Priority
 * @typedef {'high' | 'medium' | 'low' | 'none'} SoundName
 *
 * @typedef {object} Signal
 * @property {string} label
 * @property {Freshness} freshness
 * @property {number | null} age_s
 * @property {number | null} horizon_s
 * @property {number | null} period_s
 * @property {number | null} expected_hz
 * @property {number | null} rate_hz
 * @property {string | null} topic
 * @property {string | null} type
 * @property {string | null} note
 * @property {number} count
 * @property {number} rejected
 * @property {string | null} rejected_why
 * @property {string} [unit]
 * @property {number} [dropped]
 * @property {number} [repaired]
 * @property {string | null} [repaired_why]
 * @property {Record<string, any> | null} value
 * @property {number | null} lowest
 * @property {number | null} highest
 *
 * @typedef {object} Check
 * @property {string} id
 * @property {string} label
 * @property {string[]} [checks] ids of the checks behind this tile
 * @property {Verdict} verdict
 * @property {string} text
 * @property {string} brief
 *
 * @typedef {{label: string, value: number | null, unit: string}} Quantity
 *
 * @typedef {object} Alarm
 * @property {string} id
 * @property {number} occurrence
 * @property {string} title
 * @property {Priority} priority
 * @property {'dialog' | 'snackbar' | 'list'} place
 * @property {SoundName} sound
 * @property {'UNACKED' | 'ACKED' | 'RTN_UNACKED' | 'SHELVED'} state
 * @property {boolean} active
 * @property {boolean} needs_ack
 * @property {number} raised_ms
 * @property {number} for_s
 * @property {string} text
 * @property {Verdict} [verdict] what its check says now
 * @property {string} trip_text
 * @property {Quantity | null} measured
 * @property {Quantity | null} limit
 * @property {Quantity & {side: 'above' | 'below'} | null} [worst] what was measured furthest beyond its limit since it was raised
 * @property {string[]} causes
 * @property {string[]} actions
 * @property {string | null} advice
 * @property {number | null} shelved_until_ms
 * @property {string | null} [acknowledged_by]
 * @property {string | null} [shelved_by]
 *
 * @typedef {{id: string, title: string, priority: Priority, by: string[], raised_ms: number | null}} Suppressed not announced, because others explain it
 *
 * @typedef {{in_10_min: number, flood: boolean, bearable: boolean, chattering: string[]}} AlarmLoad
 *
 * @typedef {{code: string, title: string, hint: string, mark: string}} Problem
 *
 * @typedef {object} Session
 * @property {'idle' | 'connecting' | 'failed' | 'monitoring' | 'lost'} phase
 * @property {string | null} address
 * @property {string | null} name
 * @property {string | null} [configured] the car the server was started for
 * @property {number | null} ros_version
 * @property {number} [settings_version]
 * @property {string | null} [profile] the kind of car it is taken for
 * @property {number | null} connected_for_s
 * @property {boolean} paused
 * @property {number} paused_for_s
 * @property {string | null} [paused_by]
 * @property {{address: string | null, alarms: number, paused: boolean} | null} [held] what stood when the server ended
 * @property {number | null} track_m
 * @property {{number: number, last: number}} [track] which track, and its newest point
 * @property {number} received
 * @property {number} rejected
 *
 * @typedef {object} Link
 * @property {null | 'server-bridge' | 'bridge-car'} cut
 * @property {number | null} since_ms
 * @property {number | null} bridge_age_s
 * @property {number | null} car_age_s
 * @property {Problem | null} problem
 * @property {number} attempts
 * @property {number} trying_for_s
 * @property {number} topics_subscribed
 * @property {number} topics_heard
 * @property {number} [unreadable_frames]
 * @property {string | null} [unreadable_why]
 *
 * @typedef {object} State
 * @property {'state'} kind
 * @property {number} seq
 * @property {string | null} vehicle
 * @property {{time_ms: number, boot: string, version: string, pages: number, frames_skipped: number, loop_lag_ms: number}} server
 * @property {Session} session
 * @property {Link} link
 * @property {Record<string, Signal>} signals
 * @property {{time_gap_s: number | null, stopping_m: number | null}} nearest
 * @property {Check[]} checks
 * @property {Alarm[]} alarms
 * @property {Suppressed[]} [suppressed]
 * @property {AlarmLoad} [alarm_load]
 * @property {string | null} [log_trouble] why the log is not kept on the server's disk
 * @property {Trends} [trends]
 * @property {Record<string, number>} limits
 * @property {RecordingNow} recording
 * @property {Decelerate} decelerate
 * @property {ControlNow} control
 * @property {ReachNow | null} [reach] whom an alarm would reach; null: of a recording nobody is asked
 * @property {PhoneShown | null} [phone] the operator's phone that is compared with the car
 * @property {PhonePlace[]} [phones] every phone that tells where it is, or why not; the one that is compared first
 * @property {ReplayAt} [replay] of a recording: what all the rest is of
 * @property {LiveAside | null} [live] in a replay only: what is live meanwhile; null: not known
 *
 * @typedef {object} RecordingNow
 * @property {string} state off, recording, saving, held (link lost) or stopped (it was to record and cannot)
 * @property {number | null} for_s
 * @property {string | null} [name]
 * @property {number | null} [part]
 * @property {number} [bytes]
 * @property {number} [messages]
 * @property {number} [as_json]
 * @property {number} [dropped]
 * @property {string[]} [left_out] topics that are not recorded, the first of them
 * @property {number} [left_out_count] of all that are not recorded
 * @property {number} [not_received_count]
 * @property {number} [too_large_count]
 * @property {string[]} [not_received] topics that have a publisher and of which no message comes
 * @property {{topic: string, mb: number}[]} [too_large] topics that were left because of the size of their messages
 * @property {number | null} [room_gb]
 * @property {{name: string, until_ms: number} | null} [saved] the newest finished file, and the time of day it reaches
 * @property {string | null} [reason] why it does not record
 *
 * @typedef {object} Decelerate how the slow-down stands; of a recording as it stood then
 * @property {string} state not_available, safe, armed, ordered (on the ramp) or holding (zeros are held)
 * @property {string | null} why it is not available
 * @property {string | null} [topic] on which it would be commanded
 * @property {string | null} [type]
 * @property {string[] | null} [rivals] who else publishes there; null: not known
 * @property {string | null} [armed_by]
 * @property {number} [deceleration_mps2] that will be ordered
 * @property {SlowOrder | null} [order]
 * @property {{trigger: string, title: string, text: string, left_s: number} | null} [countdown] it is about to begin by itself
 * @property {Guard | null} [guard] null: none on the car
 *
 * @typedef {object} SlowOrder
 * @property {number} number
 * @property {string | null} by
 * @property {string} why "by hand", or the title of the rule that ordered it
 * @property {number} for_s
 * @property {number | null} from_mps
 * @property {number | null} ordered_mps the speed that is ordered now
 * @property {number} deceleration_mps2
 * @property {boolean} sending false: its commands do not go out
 * @property {boolean | null} confirmed by the car's own speed; null: not known
 * @property {'before' | 'unproven' | null} [stands] the car stands, and its speed does not show that the order stopped it
 * @property {{pressed_ms: number | null, server_ms: number | null, bridge_ms: number | null, slows_ms: number | null}} steps
 * @property {number} [longest_s]
 *
 * @typedef {{state: string, why: string, hold: number, age_s: number | null}} Guard
 *
 * @typedef {object} ControlNow
 * @property {string | null} holder the name of who is in control
 * @property {string | null} [page] the page that is
 * @property {number | null} [fence] the number of its lease
 * @property {number | null} [since_ms]
 * @property {number | null} [renewed_s] since it was renewed last
 * @property {number} [lapses_s] after so long without a word it lapses
 * @property {{name: string, page: string, may_return_s: number} | null} [former] whose lease lapsed, and who has it again by coming back
 * @property {{page: string, name: string, left_s: number}[]} [requests] who asks for it, and how long until silence grants it
 *
 * @typedef {object} PageHere
 * @property {string} page
 * @property {string} name
 * @property {boolean} can an alarm would be heard from it now
 * @property {string | null} why silent, blind, hidden, sound or replay
 * @property {string | null} why_text
 * @property {boolean} here it is seen now
 * @property {string} awake
 * @property {boolean} vibrates
 * @property {number | null} battery
 * @property {boolean | null} charging
 * @property {number} heard_s
 *
 * @typedef {{can: number, of: number, why: string, pages: PageHere[], left_out: number}} ReachNow
 *
 * @typedef {object} ReplayAt
 * @property {string} id
 * @property {string} token by which trends and track are asked for
 * @property {number} at_s the moment shown, or gone to, since the recording's beginning
 * @property {number} at_ms
 * @property {number} start_ms
 * @property {number} end_ms
 * @property {number} length_s
 * @property {boolean} is_playing
 * @property {number} rate
 * @property {number | null} reached_rate where it does not keep the pace
 * @property {boolean} is_seeking
 * @property {boolean} is_settled false: the checks were only warmed up before this moment
 * @property {number | null} silent_s since the car's newest message then; null: none yet
 * @property {number} seek grows with each leap: another number, another course of the minute and another track
 * @property {'recording' | 'judged'} alarms_from
 * @property {'recording' | 'now'} settings_from
 * @property {number | null} hangs_s its process tells nothing
 *
 * @typedef {object} LiveAside
 * @property {Session['phase']} phase
 * @property {string | null} name
 * @property {boolean} paused
 * @property {Link['cut']} cut
 * @property {string | null} problem
 * @property {{state: string, for_s: number | null}} recording
 * @property {ControlNow} [control]
 * @property {ReachNow | null} [reach]
 * @property {Decelerate} [decelerate]
 * @property {Alarm[]} alarms
 * @property {number} alarms_in_all
 *
 * @typedef {{at_s: number, alarm: string, title: string, priority: Priority, text: string}} Mark
 * @typedef {{kind: 'timeline', length_s: number, done_s: number, is_done: boolean, bucket_s: number, speed_mps: (number | null)[],
 *   gaps: [number, number][], marks: Mark[], marks_left_out: number, notes: string[]}} Timeline
 * @typedef {{kind: 'replay', ended: string}} ReplayEnded
 *
 * @typedef {number | 'none' | null} Step none: messages came and had no number to give; null: none came
 * @typedef {{step_s: number, since: number, first: number, now: number, lowest: Record<string, Step[]>, highest: Record<string, Step[]>}} Trends
 *
 * @typedef {PhonePlace & PhoneCompared} PhoneShown
 *
 * @typedef {object} PhoneCompared
 * @property {number} count
 * @property {'operator' | 'only' | 'first' | 'none'} [choice] who chose it: the operator, or the server for this reason
 * @property {string} [choice_text]
 * @property {number | null} apart_m
 * @property {number | null} [bearing_deg] of the car from the phone
 * @property {number | null} [compared_age_s]
 * @property {number | null} explained_m
 * @property {number | null} correlation
 *
 * @typedef {object} PhonePlace
 * @property {string} id
 * @property {string | null} label
 * @property {boolean} handheld
 * @property {number | null} lat_deg
 * @property {number | null} lon_deg
 * @property {number | null} accuracy_m
 * @property {number | null} sigma_m
 * @property {number | null} alt_m
 * @property {number | null} speed_mps
 * @property {number | null} heading_deg
 * @property {number | null} at_ms
 * @property {number | null} age_s
 * @property {boolean} used
 * @property {string | null} why
 * @property {string | null} why_text
 * @property {boolean} [compared] with the car
 * @property {boolean} [chosen] the operator said that it rides in the car
 *
 * @typedef {object} AlarmEvent
 * @property {number} n
 * @property {number} at_ms
 * @property {string | null} alarm
 * @property {number | null} [occurrence]
 * @property {string} change
 * @property {string} [title] absent where the event is of no alarm
 * @property {Priority} [priority]
 * @property {string} text
 * @property {string | null} by
 * @property {string} [act] what happened to control
 * @property {string} [step] of an order to slow down: ordered, sent, slows, not_confirmed, released …
 * @property {string | null} [by_page]
 * @property {string | null} [page] who is in control now
 * @property {string | null} [before_page]
 *
 * @typedef {{kind: 'hello', version: string, boot: string, vehicle: string | null, vehicles: string[], time_ms: number,
 *   last_event: number, veil_after_s: number, who?: {id: string, name: string, role: 'viewer' | 'operator'}, build?: string}} Hello
 * @typedef {{kind: 'offer', seq: number, of: string[]}} Offer
 * @typedef {{kind: 'events', events: AlarmEvent[], last: number}} Events
 * @typedef {{kind: 'reply', id: string, ok: boolean, reason?: string, problem?: Problem & {suggestion: string | null},
 *   version?: number, conflict?: boolean, field?: string, fence?: number, held_by?: string | null}} Reply
 * @typedef {{kind: 'problem', reason: string}} Refusal
 * @typedef {Hello | Offer | State | Events | Reply | Refusal | Timeline | ReplayEnded} Message
 */

/** What a message of each kind must at least hold, and as what; anything else is not understood. */
const SHAPES = /** @type {Record<string, Record<string, string>>} */ ({
  hello: { boot: 'string', time_ms: 'number' },
  offer: { seq: 'number' },
  state: {
    server: 'object', session: 'object', link: 'object', signals: 'object', nearest: 'object', checks: 'array',
    alarms: 'array', limits: 'object', recording: 'object', decelerate: 'object', control: 'object',
  },
  events: { events: 'array' },
  reply: { id: 'string', ok: 'boolean' },
  problem: { reason: 'string' },
  timeline: { length_s: 'number', bucket_s: 'number', speed_mps: 'array', gaps: 'array', marks: 'array', notes: 'array' },
  replay: { ended: 'string' },
});

/**
 * The message in a text frame, or null where it is none of ours: a frame that cannot be read must never stop the page.
 * @param {string} text
 * @returns {Message | null}
 */
export function readMessage(text) {
  let message;
  try {
    message = JSON.parse(text);
  } catch {
    return null;
  }
  if (message === null || typeof message !== 'object') return null;
  const shape = Object.hasOwn(SHAPES, message.kind) ? SHAPES[message.kind] : undefined;
  if (!shape) return null;
  for (const [name, kind] of Object.entries(shape)) {
    const value = message[name];
    const is = Array.isArray(value) ? 'array' : value === null ? 'null' : typeof value;
    if (is !== kind) return null;
  }
  return message;
}
