// Made from server/protocol by `python -m server.protocol.reference --write`.

export interface AccelerationValue {
  acceleration_mps2: number | null;
  /** speed: derived from the speed */
  source: "topic" | "speed";
}

/** The operator has seen this occurrence. */
export interface AcknowledgeCommand {
  id?: string | null;
  kind: "acknowledge";
  alarm: string;
  /** which occurrence was seen; an older one is refused */
  occurrence: number;
}

/** What the operator can do about it, as buttons. */
export type Action = "acknowledge" | "shelve" | "unshelve" | "decelerate" | "reconnect" | "change_address" | "exit";

/** What the alarms ask of the operator now. */
export interface AlarmLoad {
  /** announced in the last 10 minutes */
  in_10_min: number;
  flood: boolean;
  bearable: boolean;
  /** titles of the alarms that come and go */
  chattering: Array<string>;
}

export type AlarmState = "NORMAL" | "UNACKED" | "ACKED" | "RTN_UNACKED" | "SHELVED" | "SUPPRESSED" | "OUT_OF_SERVICE";

export type Answers = SettingsAnswer | SignalsAnswer | CheckAnswer | TrackPoints | RecordingList | ExportJob | DeviceList | DriveTrendsAnswer;

/** Slow-down may be ordered from now on. */
export interface ArmCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "arm";
}

export interface BearingValue {
  /** counter-clockwise, 0 ahead; null: unknown */
  bearing_rad: number | null;
}

/** The recording that is shown beside the one that the page replays, at its own moment. */
export interface Beside {
  kind: "beside";
  replay: ReplayState;
  state: RecordedState;
  /** what is to be said of the file */
  notes: Array<string>;
}

/** The recording beside is not shown any more; the first one is. */
export interface BesideEnded {
  kind: "beside_ended";
  /** one sentence */
  ended: string;
}

/** The worst alarm of a car. */
export interface CarAlarm {
  id: string;
  occurrence: number;
  title: string;
  priority: Priority;
  state: AlarmState;
  active: boolean;
  raised_ms: number;
  /** none while it is silenced */
  sound: Sound;
}

/** What the chain of a car is made of, as in LinkState and SessionState. */
export interface CarLink {
  cut: "server-bridge" | "bridge-car" | null;
  bridge_age_s: number | null;
  car_age_s: number | null;
  trying_for_s: number;
  connected_for_s: number | null;
}

export interface CarSpeed {
  value_mps: number | null;
  freshness: SignalFreshness;
  age_s: number | null;
  horizon_s: number | null;
}

/** One car, as its session states it. */
export interface CarSummary {
  phase: "idle" | "connecting" | "failed" | "monitoring" | "lost";
  paused: boolean;
  link: CarLink;
  /** unacknowledged before acknowledged, then by priority, then the newest */
  worst: CarAlarm | null;
  /** alarms that nobody has acknowledged */
  waiting: number;
  speed: CarSpeed;
  /** name of who is in control; null: nobody */
  holder: string | null;
  /** the page that is */
  page: string | null;
  recording: "off" | "recording" | "saving" | "held" | "stopped";
  recording_for_s: number | null;
  slow_down: "not_available" | "safe" | "armed" | "ordered" | "holding";
}

/** All cars of a server that watches several: twice a second, and at once when the alarms of one change. */
export interface Cars {
  kind: "cars";
  time_ms: number;
  cars: Array<ListedCar>;
}

/** `GET /api/checks/{name}`. */
export interface CheckAnswer {
  id: string;
  label: string;
  /** label of its tile */
  tile: string;
  /** all checks of this tile, this one included */
  checks: Array<TileCheck>;
  verdict: Verdict;
  text: string;
  /** since when it answers so; null: it has not answered */
  for_s: number | null;
  measured: Quantity | null;
  limit: Quantity | null;
  /** what makes it checked, as a sentence */
  checked_when: string;
  /** full names of its thresholds */
  settings: Array<string>;
  /** of its alarm */
  title: string;
  priority: Priority;
  delays: CheckDelays;
  /** null: it ends at the limit that raises it, or by no single value */
  ends: CheckEnd | null;
  advice: string;
  /** titles of the alarms that explain its alarm now */
  suppressed_by: Array<string>;
  /** the signal whose trend shows what it measures; null: none does */
  signal: string | null;
  minute: CheckMinuteState;
  /** of a replay: its alarms up to the moment shown, as the log has them; null: not read so far */
  history?: Array<LogEvent> | null;
}

/** When a fault becomes an alarm, and when the alarm ends. */
export interface CheckDelays {
  on_s: number;
  off_s: number;
}

/** The value at which the alarm ends, where it is another one than its limit; SI. */
export interface CheckEnd {
  side: "below" | "above";
  value: number | null;
  unit: string;
}

/** What the check measured in the last minute, a number each step, the newest last. */
export interface CheckMinuteState {
  step_s: number;
  /** null: not checked then */
  values: Array<number | null>;
  limits: Array<number | null>;
}

/** Closes the second recording; the first one stays. */
export interface CloseBeside {
  kind: "replay";
  id?: string | null;
  do: "alone";
}

export interface CommandValue {
  /** null: unknown */
  speed_mps: number | null;
  /** null: unknown */
  tyre_angle_rad: number | null;
}

export interface ComponentState {
  name: string;
  /** 0 OK, 1 warning, 2 error, 3 stale */
  level: number;
  message: string;
}

/** Dials a car; it is tried until disconnected. */
export interface ConnectCommand {
  id?: string | null;
  kind: "connect";
  /** host, host:port, ws:// or wss://; empty: the car that was configured */
  address?: string;
}

export interface ConnectionProblem {
  code: string;
  /** one sentence */
  title: string;
  /** what to do */
  hint: string;
  /** a word under the broken node of the chain */
  mark: string;
}

export interface ControlRequest {
  page: string;
  name: string;
  /** until silence grants it */
  left_s: number;
}

/** Who is in control. */
export interface ControlState {
  /** name of who is in control; null: nobody */
  holder: string | null;
  /** the page that is */
  page?: string | null;
  /** number of its lease */
  fence?: number | null;
  since_ms?: number | null;
  /** since the lease was renewed */
  renewed_s?: number | null;
  /** after so long without renewal it lapses */
  lapses_s?: number;
  /** whose lease lapsed, and who can reclaim it until then */
  former?: FormerHolder | null;
  /** who asks for control, the oldest first */
  requests?: Array<ControlRequest>;
}

/** A slow-down that begins by itself, unless it is vetoed. */
export interface Countdown {
  trigger: string;
  title: string;
  text: string;
  left_s: number;
}

/** Slows the car, once armed; refused where it took longer than 300 ms on its way. */
export interface DecelerateCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "slow_down";
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
}

/** `GET /api/devices`. */
export interface DeviceList {
  you: string;
  /** this server pairs no devices */
  open: boolean;
  devices: Array<DeviceRow>;
}

/** A paired device. */
export interface DeviceRow {
  id: string;
  name: string;
  role: "viewer" | "operator";
  paired_ms: number;
  seen_ms: number;
  /** pages it has open now */
  sockets: number;
}

export interface DiagnosticsValue {
  /** 0 … 3 */
  worst: number;
  /** at most 50, the worst first */
  components: Array<ComponentState>;
}

/** Slow-down may not be ordered any more. */
export interface DisarmCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "disarm";
}

/** Ends monitoring: the session is idle. */
export interface DisconnectCommand {
  id?: string | null;
  kind: "disconnect";
}

export interface DistanceValue {
  /** null: none in range */
  distance_m: number | null;
  none_in_range: boolean;
}

/** One signal of the drive in buckets. */
export interface DriveTrend {
  /** of each bucket; null: no number in it */
  lowest: Array<number | null>;
  highest: Array<number | null>;
  /** from and to, where no message of it came */
  gaps: Array<[number, number]>;
  /** from and to, where messages had no number: nothing in range */
  none: Array<[number, number]>;
  /** from when on which threshold stood beside it */
  limits: Array<[number, number]>;
}

/** `GET /api/trends/drive`. Times are seconds since the drive began. */
export interface DriveTrendsAnswer {
  /** when the drive began, in ms since 1970 */
  start_ms: number;
  /** of the drive until now, or of the recording */
  length_s: number;
  /** up to here the server has read it: less than the length while it reads a recording */
  known_s: number;
  /** the buckets are those of the sketch, until the recording is read */
  is_sketch: boolean;
  /** the beginning of the first bucket */
  from_s: number;
  /** the width of a bucket */
  step_s: number;
  signals: Record<string, DriveTrend>;
  /** all that can be drawn */
  offered: Record<string, TrendOffer>;
  /** from and to, where no message of any signal came */
  blind: Array<[number, number]>;
  /** of the part that is answered; at most 100, the most urgent */
  marks: Array<TrendMark>;
  marks_left_out: number;
}

/** Events of the log, at most 100. */
export interface Events {
  kind: "events";
  events: Array<LogEvent>;
  /** the newest number there is */
  last: number;
}

export interface ExportFormat {
  name: string;
  label: string;
  use: string;
  /** only recordings of it can be exported; null: all */
  ros_version: number | null;
}

/** An export or a clip, as `GET /api/exports/{job}` answers. */
export interface ExportJob {
  job: string;
  /** the recording */
  of: string;
  format: string;
  state: "waiting" | "working" | "done" | "failed" | "cancelled";
  progress: number;
  /** of one that failed: why; of a clip that waits: for how long */
  sentence: string;
  /** what is not in it, and remarks, a sentence each */
  notes: Array<string>;
  /** false: something of the recording is not in it, and `notes` name it; null: not made yet */
  is_whole: boolean | null;
  size_bytes: number | null;
  /** of a clip that is done: the id of the new recording */
  recording: string | null;
}

/** A position as the W3C Geolocation API gives it, WGS84. No clock of the page is compared with the server's: `age_s` is reckoned on the phone, and `heard_ms` is the server's own time in the newest state that the page had, `held_s` how long it had had it. */
export interface Fix {
  lat_deg: number;
  lon_deg: number;
  accuracy_m: number;
  alt_m?: number | null;
  speed_mps?: number | null;
  heading_deg?: number | null;
  at_ms: number;
  age_s: number;
  heard_ms: number;
  held_s: number;
}

export interface FormerHolder {
  name: string;
  page: string;
  may_return_s: number;
}

export interface FuelValue {
  value: number | null;
  /** % or l */
  unit: string;
}

/** The guard on the car. */
export interface GuardState {
  state: "unguarded" | "guarded" | "operator" | "slowing" | "holding";
  why: string;
  hold: number;
  age_s: number;
}

/** The page has the events that were sent. */
export interface Have {
  kind: "have";
  /** number of the newest of them */
  event: number;
}

export interface HeadingValue {
  /** 0 north, clockwise */
  heading_deg: number | null;
  source: "topic" | "odometry" | "track";
}

/** What stood when the server ended. */
export interface HeldState {
  address: string | null;
  alarms: number;
  paused: boolean;
}

export interface Hello {
  kind: "hello";
  version: string;
  /** another one: another run of the server */
  boot: string;
  vehicle: string;
  vehicles: Array<string>;
  /** of the page that the server has now; "" for single modules */
  build: string;
  time_ms: number;
  last_event: number;
  /** without a message for so long a page covers its values */
  veil_after_s: number;
  who: Identity;
}

/** The device that a socket is of. */
export interface Identity {
  id: string;
  name: string;
  role: "viewer" | "operator";
}

/** All settings at once, from a TOML file. */
export interface ImportCommand {
  id?: string | null;
  kind: "import";
  toml: string;
}

/** Back to live. */
export interface LeaveReplay {
  kind: "replay";
  id?: string | null;
  do: "leave";
}

export interface LinkState {
  /** which part of the chain is broken; null: none */
  cut: "server-bridge" | "bridge-car" | null;
  /** when what is beyond the cut was last heard */
  since_ms: number | null;
  /** since the bridge was last heard; null: never */
  bridge_age_s: number | null;
  /** since the car was last heard; null: never */
  car_age_s: number | null;
  /** may be there while cut is null: a part behind the bridge failed, and messages still come */
  problem: ConnectionProblem | null;
  attempts: number;
  trying_for_s: number;
  topics_subscribed: number;
  topics_heard: number;
  /** how old messages are when they come, at most; null: not known */
  late_s: number | null;
  /** what is not asked for in full because the link is slow, as a sentence */
  reduced: string | null;
  /** what came and was no rosbridge operation */
  unreadable_frames: number;
  unreadable_why: string | null;
}

export interface ListedCar {
  name: string;
  /** of the summary when this was sent; null: there was none in this run */
  age_s: number | null;
  /** null: its session has stopped, and nothing is known of the car now */
  summary: CarSummary | null;
}

/** What is live while a page replays. */
export interface LiveSummary {
  phase: "idle" | "connecting" | "failed" | "monitoring" | "lost";
  name: string | null;
  paused: boolean;
  cut: "server-bridge" | "bridge-car" | null;
  problem: string | null;
  recording: RecordingState;
  control: ControlState;
  reach: ReachState | null;
  decelerate: SlowDownState;
  /** at most 8 */
  alarms: Array<StandingAlarm>;
  alarms_in_all: number;
}

/** One event of the log. */
export interface LogEvent {
  /** what happened to control; below */
  act?: string;
  by_page?: string | null;
  /** who is in control now */
  holder?: string | null;
  page?: string | null;
  /** who was in control until now */
  before?: string | null;
  before_page?: string | null;
  fence?: number | null;
  /** ordered · sent · slows · not_confirmed · released …; of reduced: how far */
  step?: string | number;
  /** number of the order */
  order?: number;
  why?: string;
  ordered_by?: string;
  commanded_mps?: number | null;
  tyre_rad?: number | null;
  topic?: string;
  stands?: "before" | "unproven" | null;
  /** the rule that counts down */
  trigger?: string;
  /** number of the guard's hold */
  hold?: number;
  address?: string;
  /** all that are in force, as monitoring begins */
  settings?: Record<string, any>;
  /** name of a setting → from, to */
  changes?: Record<string, Array<any>>;
  /** the recording that was recovered */
  recording?: string;
  /** the phone that was chosen */
  phone?: string | null;
  /** when the pause began */
  since_ms?: number;
  at_ms: number;
  /** null: of no alarm */
  alarm: string | null;
  /** what happened; below */
  change: string;
  text: string;
  /** who did it, where a person did */
  by: string | null;
  settings_version: number;
  occurrence?: number;
  title?: string;
  priority?: Priority;
  place?: Place;
  sound?: Sound;
  /** the operator is to be alerted */
  announces?: boolean;
  state?: AlarmState;
  causes?: Array<string>;
  suppressed_by?: Array<string>;
  shelved_until_ms?: number | null;
  measured?: Quantity | null;
  limit?: Quantity | null;
  /** furthest beyond its limit since it was raised */
  worst?: Worst | null;
  /** its number: grows by one, never given twice */
  n: number;
}

/** An announcement of an alarm in a recording. */
export interface Mark {
  at_s: number;
  alarm: string;
  title: string;
  priority: Priority;
  text: string;
  /** until it returned to normal; null: not yet, as far as `done_s` */
  duration_s: number | null;
}

export type Message = Hello | Offer | State | Cars | Events | Reply | Problem | Timeline | Beside | BesideEnded | ReplayEnded;

export interface NearestState {
  /** null while standing */
  time_gap_s: number | null;
  stopping_m: number | null;
}

export interface OdometryValue {
  x_m: number | null;
  y_m: number | null;
  yaw_rad: number | null;
  speed_mps: number | null;
}

/** Something newer than the page has. */
export interface Offer {
  kind: "offer";
  seq: number;
  of: Array<"state" | "scan" | "timeline" | "cars" | "beside">;
}

/** Opens a second recording beside the one that is replayed, to compare both. */
export interface OpenBeside {
  kind: "replay";
  id?: string | null;
  do: "beside";
  recording: string;
  at_s?: number;
}

/** Opens a recording by its id, at a moment [s since its beginning]. */
export interface OpenReplay {
  kind: "replay";
  id?: string | null;
  do: "open";
  recording: string;
  at_s?: number;
}

/** When; null: not (yet). */
export interface OrderSteps {
  pressed_ms: number | null;
  server_ms: number | null;
  bridge_ms: number | null;
  slows_ms: number | null;
}

/** Before everything else but `take`: the server then sends what the page missed, and no event before it (or 1 s after the connection, where none comes). */
export interface PageHello {
  kind: "hello";
  /** number of the newest event that the page has */
  have_event?: number | null;
  /** of the server that it is of */
  boot?: string | null;
  /** what its operator calls it */
  name?: string;
  /** what it calls itself, kept over reloads; without it the server gives it one */
  page?: string;
}

export type PageMessage = PageHello | Take | Have | Watch | OpenReplay | OpenBeside | CloseBeside | LeaveReplay | SeekReplay | PlayReplay | PauseReplay | SetReplayRate | SeekReplayAlarm | ConnectCommand | RetryCommand | DisconnectCommand | PauseCommand | ResumeCommand | RecordCommand | AcknowledgeCommand | SilenceCommand | ShelveCommand | UnshelveCommand | SetCommand | ImportCommand | PositionCommand | RideCommand | TakeControlCommand | ArmCommand | DisarmCommand | DecelerateCommand | ReleaseCommand | VetoCommand | PresentWordCommand;

/** One page of an operator. */
export interface PagePresence {
  page: string;
  name: string;
  /** an alarm would be audible on it now */
  can: boolean;
  /** silent: not heard for 3 s; blind: it receives nothing for 2 s; undrawn: its drawing failed */
  why: "silent" | "blind" | "hidden" | "undrawn" | "sound" | "replay" | null;
  why_text: string | null;
  /** it is seen now, so that control can be handed to it */
  here: boolean;
  awake: "ready" | "refused" | "asks" | "missing" | "interrupted";
  vibrates: boolean;
  battery: number | null;
  charging: boolean | null;
  heard_s: number | null;
}

/** Pauses monitoring: values go on, no alarm comes. */
export interface PauseCommand {
  id?: string | null;
  kind: "pause";
}

/** Stands still. */
export interface PauseReplay {
  kind: "replay";
  id?: string | null;
  beside?: boolean;
  do: "pause";
}

export interface PedalValue {
  percent: number | null;
}

/** The phone that is compared with the car. */
export interface PhoneCompared {
  id: string;
  label: string | null;
  handheld: boolean;
  /** the operator in control chose it as the one in the car */
  chosen: boolean;
  /** its newest fix, WGS84; null before there is one */
  lat_deg: number | null;
  lon_deg: number | null;
  accuracy_m: number | null;
  sigma_m: number | null;
  alt_m: number | null;
  speed_mps: number | null;
  heading_deg: number | null;
  /** by the phone's own clock: to be shown only */
  at_ms: number | null;
  /** since it was measured */
  age_s: number | null;
  /** it can be compared with the car */
  used: boolean;
  /** why it is not used. coarse: worse than 50 m; old: 5 s; late: came slowly; silent: 5 s; off: it left */
  why: "denied" | "unavailable" | "timeout" | "insecure" | "hidden" | "off" | "coarse" | "old" | "late" | "silent" | null;
  why_text: string | null;
  /** how many phones share their position */
  count: number;
  /** why it is this one. first: with a usable position; none: none has one */
  choice: "operator" | "only" | "first" | "none";
  choice_text: string;
  /** the newest comparison: the distance */
  apart_m: number | null;
  /** of the car from the phone: 0 north, clockwise */
  bearing_deg: number | null;
  /** since the moment that was compared, which is the phone's */
  compared_age_s: number | null;
  /** what the errors of both explain */
  explained_m: number | null;
  /** of the tracks of the last minute; null: one of them did not move */
  correlation: number | null;
}

export interface PhoneListed {
  id: string;
  label: string | null;
  handheld: boolean;
  /** the operator in control chose it as the one in the car */
  chosen: boolean;
  /** its newest fix, WGS84; null before there is one */
  lat_deg: number | null;
  lon_deg: number | null;
  accuracy_m: number | null;
  sigma_m: number | null;
  alt_m: number | null;
  speed_mps: number | null;
  heading_deg: number | null;
  /** by the phone's own clock: to be shown only */
  at_ms: number | null;
  /** since it was measured */
  age_s: number | null;
  /** it can be compared with the car */
  used: boolean;
  /** why it is not used. coarse: worse than 50 m; old: 5 s; late: came slowly; silent: 5 s; off: it left */
  why: "denied" | "unavailable" | "timeout" | "insecure" | "hidden" | "off" | "coarse" | "old" | "late" | "silent" | null;
  why_text: string | null;
  /** with the car */
  compared: boolean;
}

export type Place = "dialog" | "snackbar" | "list";

/** Goes on; from the beginning where it stands at the end. */
export interface PlayReplay {
  kind: "replay";
  id?: string | null;
  beside?: boolean;
  do: "play";
}

/** Where this phone is, or why that is not known: either `fix` or `why`. */
export interface PositionCommand {
  id?: string | null;
  kind: "position";
  phone: string;
  handheld: boolean;
  fix?: Fix | null;
  why?: "denied" | "unavailable" | "timeout" | "insecure" | "hidden" | "off" | null;
}

export interface PositionValue {
  lat_deg: number | null;
  lon_deg: number | null;
  alt_m: number | null;
  /** −1: no fix */
  status: number;
  /** null: quality unknown */
  sigma_m: number | null;
  /** east, north, east-north */
  covariance_m2: [number, number, number] | null;
}

/** How a page stands, once a second and at each change: whether it is seen, and whether an alarm would be heard from it. Nothing answers it but its refusal. */
export interface PresentWordCommand {
  id?: string | null;
  kind: "present";
  visible: boolean;
  /** false: drawing fails, and the page covers its values */
  draws?: boolean;
  sound: "ready" | "refused" | "asks" | "missing" | "interrupted";
  awake: "ready" | "refused" | "asks" | "missing";
  vibrates?: boolean;
  battery?: number | null;
  charging?: boolean | null;
  /** age of its newest state */
  lag_s?: number;
  /** it is closed, or another page takes its place */
  leaves?: boolean;
  /** the other cars whose next alarm would be heard from it */
  announces?: Array<string>;
}

export type Priority = "critical" | "warning" | "advisory";

/** A message of the page that could not be understood or was too much; it has no id. */
export interface Problem {
  kind: "problem";
  reason: string;
}

/** The kind of car. */
export interface ProfileAnswer {
  name: string;
  title: string;
  /** by the operator; auto: as recognised */
  chosen: string;
  recognised: string;
}

export interface ProfileChoice {
  name: string;
  title: string;
}

export interface Quantity {
  label: string;
  value: number | null;
  unit: string;
}

export interface RaisedAlarm {
  at_ms: number;
  priority: Priority;
  alarm: string;
  title: string;
  text: string;
}

/** How many operators would hear an alarm now. */
export interface ReachState {
  can: number;
  of: number;
  /** why the others would not */
  why: string;
  /** at most 12; a page silent for 5 min is forgotten */
  pages: Array<PagePresence>;
  left_out: number;
}

/** Begins or ends a recording by hand; refused with the reason, the disk's too. */
export interface RecordCommand {
  id?: string | null;
  kind: "record";
  /** true begins a recording, false ends the one that is made */
  on: boolean;
}

/** A state without what the server adds. */
export interface RecordedState {
  kind: "state";
  vehicle: string;
  session: SessionState;
  link: LinkState;
  signals: Signals;
  nearest: NearestState;
  checks: Array<Tile>;
  /** the most urgent first */
  alarms: Array<StandingAlarm>;
  /** not announced, because others explain them; at most 20 */
  suppressed: Array<SuppressedAlarm>;
  alarm_load: AlarmLoad;
  /** why the log is not stored on the server's disk */
  log_trouble: string | null;
  /** the newest steps of the trends */
  trends: Trends;
  /** every threshold in force, by its full name */
  limits: Record<string, number>;
  recording: RecordingState;
  /** the slow-down */
  decelerate: SlowDownState;
  control: ControlState;
  /** whom an alarm would reach; null: of a recording */
  reach: ReachState | null;
  /** the phone that is compared with the car; null: none */
  phone: PhoneCompared | null;
  /** all that share a position, at most 12, the one compared first */
  phones: Array<PhoneListed>;
}

/** A row of `GET /api/recordings`. */
export interface Recording {
  id: string;
  vehicle: string;
  session: string | null;
  part: number | null;
  started_ms: number;
  /** null: not read yet, or unreadable */
  length_s: number | null;
  size_bytes: number;
  /** null: no position */
  distance_m: number | null;
  /** null: no speed */
  top_speed_mps: number | null;
  /** raised in it; null: no alarms were recorded with it */
  alarms: Record<string, number> | null;
  title: string;
  note: string;
  tags: Array<string>;
  /** waiting: listed by its name, and read soon */
  state: "waiting" | "read" | "unreadable";
  /** why it cannot be read, as a sentence */
  problem: string | null;
  /** what of it cannot be read, a sentence each */
  damage: Array<string>;
  /** topics that were not recorded; at most 10 */
  left_out: Array<string>;
  left_out_count: number;
  /** topics that had a publisher at the end, and of which no message came; at most 10 */
  not_received: Array<string>;
  not_received_count: number;
  /** null: not read yet */
  ros_version: number | null;
  /** closed · recovered; null: not known */
  ended: string | null;
  ended_why: string | null;
  is_clip: boolean;
  clip_of: string | null;
  /** its name in the folder */
  file: string;
  /** mcap · bag · db3 */
  format: string;
  sha256: string | null;
  thumbnail: string;
  /** null: no position */
  sketch: SketchAnswer | null;
  trashed_ms: number | null;
  /** of a recording that is asked for alone; at most 200 */
  raised?: Array<RaisedAlarm>;
  /** of a recording that is asked for alone: the highest speed of at most 361 equal parts; empty: none */
  speed_mps?: Array<number | null>;
}

/** `GET /api/recordings`. */
export interface RecordingList {
  vehicles: Array<string>;
  tags: Array<string>;
  recordings: Array<Recording>;
  /** the `cursor` of the page after this one */
  next: string | null;
  found: Total;
  all: Total;
  trash: Total;
  free_bytes: number | null;
  /** files that are yet to be read */
  waiting: number;
  formats: Array<ExportFormat>;
}

/** The recording; a replay's has `state` and `for_s` only. */
export interface RecordingState {
  left_out_count?: number;
  not_received_count?: number;
  too_large_count?: number;
  /** not recorded: bulky, too many, or with messages that are too large; at most 20 */
  left_out?: Array<string>;
  /** have a publisher, and no message comes, as CBOR or as JSON; at most 20 */
  not_received?: Array<string>;
  /** left after two messages of more than 16 MB; at most 20 */
  too_large?: Array<TooLarge>;
  /** saving: being completed; held: link lost, it goes on if that returns in time; stopped: it was to record and cannot */
  state: "off" | "recording" | "saving" | "held" | "stopped";
  for_s: number | null;
  /** of the file that is written, or the last of this session; part 2 is named …_p2 */
  name?: string | null;
  part?: number | null;
  bytes?: number;
  /** of the car, in this part */
  messages?: number;
  /** of them, kept as JSON: not of their type, or of a type whose definition is not known */
  as_json?: number;
  /** of this session, not recorded because the disk was too slow */
  dropped?: number;
  /** what may still be recorded before a limit stops it */
  room_gb?: number | null;
  /** the newest finished file; null: none in this run */
  saved?: SavedFile | null;
  /** why it does not record, as a sentence */
  reason?: string | null;
}

export interface RefusedAddress {
  code: string;
  /** one sentence */
  title: string;
  /** what to do */
  hint: string;
  /** a word under the broken node of the chain */
  mark: string;
  /** an address that would do */
  suggestion: string | null;
}

/** Ends the order, or the guard's hold, of this number: whoever drives may drive on. */
export interface ReleaseCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "release";
  /** of the very order that ends, as the state names it */
  number: number;
}

/** The page's replay is over, or could not begin; what follows is live. */
export interface ReplayEnded {
  kind: "replay";
  /** one sentence */
  ended: string;
}

export interface ReplayState {
  /** the moment shown, or sought, since the recording's beginning */
  at_s: number;
  at_ms: number;
  start_ms: number;
  end_ms: number;
  length_s: number;
  is_playing: boolean;
  rate: number;
  /** a number where the server does not keep the pace */
  reached_rate: number | null;
  /** the rest is still the picture of before */
  is_seeking: boolean;
  /** false: the checks were only warmed up over the 25 s before; below */
  is_settled: boolean;
  /** since the car's newest message then; null: there was none yet */
  silent_s: number | null;
  /** grows with each leap: another number, another minute and another track */
  seek: number;
  /** original alarms, or re-evaluated */
  alarms_from: "recording" | "judged";
  /** now: the recording does not hold the settings in force */
  settings_from: "recording" | "now";
  /** of the recording */
  id: string;
  /** the car that was recorded */
  vehicle: string;
  /** given by a person; "": none */
  title: string;
  /** by which trends and track are asked for */
  token: string;
  /** its process has sent nothing for so long */
  hangs_s: number | null;
}

/** The answer to one command. */
export interface Reply {
  ok: boolean;
  /** one sentence */
  reason?: string;
  /** of an address that cannot be dialled */
  problem?: RefusedAddress;
  /** the setting at fault */
  field?: string | null;
  /** the settings changed meanwhile */
  conflict?: boolean;
  /** of the settings, once changed */
  version?: number;
  /** number of the lease that the page has */
  fence?: number;
  /** who is in control instead */
  held_by?: string | null;
  kind: "reply";
  /** of the command */
  id: string;
}

/** Ends the pause. */
export interface ResumeCommand {
  id?: string | null;
  kind: "resume";
}

/** Dials at once. */
export interface RetryCommand {
  id?: string | null;
  kind: "retry";
}

/** Chooses the phone that is in the car and is compared with it. */
export interface RideCommand {
  id?: string | null;
  kind: "ride";
  /** null: none is chosen, one is found */
  phone: string | null;
}

export interface SavedFile {
  name: string;
  until_ms: number;
}

export interface ScanValue {
  beams: number;
  usable: number;
  angle_min_rad: number | null;
  angle_increment_rad: number | null;
  range_min_m: number | null;
  range_max_m: number | null;
  nearest_m: number | null;
  nearest_bearing_rad: number | null;
  frame_id: string;
}

/** To a moment; beyond an end is that end. */
export interface SeekReplay {
  kind: "replay";
  id?: string | null;
  beside?: boolean;
  do: "seek";
  at_s: number;
}

/** To the alarm after (1) or before (−1) this moment. */
export interface SeekReplayAlarm {
  kind: "replay";
  id?: string | null;
  do: "alarm";
  direction: -1 | 1;
}

/** The server, now. */
export interface ServerState {
  time_ms: number;
  /** another one: another run of the server */
  boot: string;
  version: string;
  pages: number;
  /** replaced by newer ones before a page took them */
  frames_skipped: number;
  loop_lag_ms?: number;
}

export interface SessionState {
  /** idle: no address; connecting: first attempts; failed: never connected yet, it keeps trying; monitoring: link open; lost: was open, it keeps trying */
  phase: "idle" | "connecting" | "failed" | "monitoring" | "lost";
  address: string | null;
  name: string | null;
  /** the car that the server was started for: connect without an address */
  configured: string | null;
  /** null until known */
  ros_version: number | null;
  /** the kind of car it is taken for */
  profile: string;
  /** another number: ask GET /api/settings again */
  settings_version: number;
  connected_for_s: number | null;
  paused: boolean;
  paused_by: string | null;
  paused_for_s: number;
  /** what was active when the server ended, while no car is monitored yet */
  held: HeldState | null;
  /** distance driven since connecting, from the car's positions */
  track_m: number | null;
  track: TrackState;
  received: number;
  rejected: number;
}

/** Changes settings. */
export interface SetCommand {
  id?: string | null;
  kind: "set";
  /** in SI; null goes back to the default */
  values?: Record<string, number | null>;
  /** signal → topic; null: as found */
  topics?: Record<string, string | null>;
  /** a profile's name, or auto */
  profile?: string | null;
  /** refused where the settings are no longer at this version */
  version?: number | null;
}

/** The pace: 0.25, 0.5, 1, 2, 4, 8 or 16. */
export interface SetReplayRate {
  kind: "replay";
  id?: string | null;
  beside?: boolean;
  do: "rate";
  rate: number;
}

/** One threshold as it is declared, in SI. */
export interface SettingField {
  title: string;
  /** its heading in Settings */
  heading: string;
  unit: string;
  default: number;
  minimum: number;
  maximum: number;
  step?: number;
  description?: string | null;
  type?: string;
}

/** `GET /api/settings`. */
export interface SettingsAnswer {
  version: number;
  profile: ProfileAnswer;
  profiles: Array<ProfileChoice>;
  /** in force, by full name */
  values: Record<string, number>;
  defaults: Record<string, number>;
  /** what differs from its default */
  changed: Array<string>;
  /** signal → topic, of those that were chosen */
  topics: Record<string, string>;
  /** in the order of Settings */
  schema: Record<string, SettingField>;
}

/** Hides an alarm for a time. */
export interface ShelveCommand {
  id?: string | null;
  kind: "shelve";
  alarm: string;
  occurrence: number;
  minutes?: number;
}

export type SignalFreshness = "fresh" | "ageing" | "stale" | "never" | "not_published";

/** One signal. */
export interface SignalState<Value> {
  label: string;
  /** of the headline number */
  unit: string;
  /** ageing: > 3 periods; stale: > max(10 periods, 1 s); never: subscribed to, and nothing came */
  freshness: SignalFreshness;
  /** since it came */
  age_s: number | null;
  /** how old it was when it came, at most */
  delay_s: number | null;
  /** the age at which it is stale */
  horizon_s: number | null;
  period_s: number | null;
  expected_hz: number | null;
  rate_hz: number | null;
  topic: string | null;
  type: string | null;
  /** "Float64, expected Float32: reading it as Float64" */
  note: string | null;
  /** why the newest messages cannot be used: "not a number (linear.x)" */
  unusable: string | null;
  count: number;
  rejected: number;
  rejected_why: string | null;
  /** messages that were corrected when they were read */
  repaired: number;
  repaired_why: string | null;
  /** null: nothing came; its fields: below */
  value: Value | null;
  /** of the headline number since connecting; null where there is none */
  lowest: number | null;
  highest: number | null;
}

export interface Signals {
  speed: SignalState<SpeedValue>;
  acceleration: SignalState<AccelerationValue>;
  brake: SignalState<PedalValue>;
  accelerator: SignalState<PedalValue>;
  steering: SignalState<SteeringValue>;
  distance: SignalState<DistanceValue>;
  bearing: SignalState<BearingValue>;
  position: SignalState<PositionValue>;
  odometry: SignalState<OdometryValue>;
  heading: SignalState<HeadingValue>;
  scan: SignalState<ScanValue>;
  diagnostics: SignalState<DiagnosticsValue>;
  command: SignalState<CommandValue>;
  fuel: SignalState<FuelValue>;
}

/** `GET /api/signals`. */
export interface SignalsAnswer {
  /** topics that can carry each signal, those of the expected type first; null: the bridge does not say */
  candidates: Record<string, Array<TopicOffer>> | null;
  /** beyond the signals */
  topics: Array<TopicOffer>;
  /** label of a signal → reason → how many */
  rejected: Record<string, Record<string, number>>;
  unreadable_frames: Record<string, number>;
  unasked: number;
}

/** No sound of this occurrence for 30 s; it still waits for its acknowledgement. */
export interface SilenceCommand {
  id?: string | null;
  kind: "silence";
  alarm: string;
  /** which occurrence is silenced; an older one is refused */
  occurrence: number;
}

/** The track in a square of 64, y down. */
export interface SketchAnswer {
  /** x, y, x, y … */
  lines: Array<Array<number>>;
  start: Array<number>;
  /** x, y and priority of each alarm */
  marks: Array<[number, number, string]>;
}

/** The active order. */
export interface SlowDownOrder {
  number: number;
  by: string;
  /** "by hand", or the title of the rule that ordered it */
  why: string;
  for_s: number;
  from_mps: number | null;
  ordered_mps: number | null;
  deceleration_mps2: number;
  /** false: its commands are not sent; it goes on when the link is back, if it is not released */
  sending: boolean;
  /** by a change of the car's own speed; null: not known; false: not confirmed, use the physical stop */
  confirmed: boolean | null;
  /** before: the car stood when it was ordered; unproven: it stands, and its speed does not show why */
  stands: "before" | "unproven" | null;
  steps: OrderSteps;
  longest_s: number;
}

export interface SlowDownState {
  /** ordered: on its ramp; holding: zeros are held */
  state: "not_available" | "safe" | "armed" | "ordered" | "holding";
  /** why it is not available, as a sentence */
  why: string | null;
  topic?: string | null;
  type?: string | null;
  /** who else publishes there; null: not known */
  rivals?: Array<string> | null;
  armed_by?: string | null;
  /** that will be ordered */
  deceleration_mps2?: number;
  order?: SlowDownOrder | null;
  countdown?: Countdown | null;
  /** null: no guard on the car, link loss will NOT slow it */
  guard?: GuardState | null;
}

/** In the manner of IEC 60601-1-8: bursts of 10, 3 and 2 pulses. */
export type Sound = "high" | "medium" | "low" | "none";

export interface SpeedValue {
  /** forward + */
  speed_mps: number | null;
  /** counter-clockwise; null: the car does not send it */
  yaw_rate_radps: number | null;
}

/** An alarm that is active, or has ended and is not acknowledged. */
export interface StandingAlarm {
  id: string;
  /** counts announcements; below */
  occurrence: number;
  title: string;
  priority: Priority;
  /** where it is shown now */
  place: Place;
  sound: Sound;
  state: AlarmState;
  active: boolean;
  /** it stays until it is acknowledged, although its condition has gone */
  needs_ack: boolean;
  raised_ms: number;
  for_s: number;
  /** what its check finds now: ok: it clears after its delay; unknown: it stays active, and is not checked */
  verdict: Verdict;
  text: string;
  /** as it was announced */
  trip_text: string;
  measured: Quantity | null;
  limit: Quantity | null;
  /** what was measured furthest beyond its limit since it was raised */
  worst: Worst | null;
  causes: Array<string>;
  /** possible now: acknowledge while nobody has, also once it returned; unshelve while shelved */
  actions: Array<Action>;
  advice: string;
  acknowledged_by: string | null;
  shelved_until_ms: number | null;
  shelved_by: string | null;
  /** no sound until then; null: it sounds while it is unacknowledged */
  silenced_until_ms: number | null;
  silenced_by: string | null;
}

/** What a page gets: the state of a vehicle, or of a recording. */
export interface State {
  kind: "state";
  vehicle: string;
  session: SessionState;
  link: LinkState;
  signals: Signals;
  nearest: NearestState;
  checks: Array<Tile>;
  /** the most urgent first */
  alarms: Array<StandingAlarm>;
  /** not announced, because others explain them; at most 20 */
  suppressed: Array<SuppressedAlarm>;
  alarm_load: AlarmLoad;
  /** why the log is not stored on the server's disk */
  log_trouble: string | null;
  /** the newest steps of the trends */
  trends: Trends;
  /** every threshold in force, by its full name */
  limits: Record<string, number>;
  recording: RecordingState;
  /** the slow-down */
  decelerate: SlowDownState;
  control: ControlState;
  /** whom an alarm would reach; null: of a recording */
  reach: ReachState | null;
  /** the phone that is compared with the car; null: none */
  phone: PhoneCompared | null;
  /** all that share a position, at most 12, the one compared first */
  phones: Array<PhoneListed>;
  server: ServerState;
  /** of a recording only */
  replay?: ReplayState;
  /** of a recording only: what is live meanwhile */
  live?: LiveSummary | null;
}

export interface SteeringValue {
  /** negative: left */
  percent: number | null;
  /** angle of the front tyres, positive: left; null: not known for this car */
  tyre_rad: number | null;
}

export type Step = number | "none" | null;

/** Not announced, because others explain it. */
export interface SuppressedAlarm {
  id: string;
  title: string;
  priority: Priority;
  /** titles of the alarms that explain it */
  by: Array<string>;
  raised_ms: number | null;
}

/** Takes what was offered. */
export interface Take {
  kind: "take";
  seq: number;
}

/** Takes, gives or requests control; server/control/lease.py says who may do what. */
export interface TakeControlCommand {
  id?: string | null;
  kind: "control";
  do: "take" | "take_over" | "release" | "request" | "withdraw" | "hand_over" | "keep";
  /** of hand_over: the page that gets it; of keep: whose request is refused */
  to?: string | null;
}

/** One tile of Home: a check, or several of one thing. */
export interface Tile {
  id: string;
  label: string;
  verdict: Verdict;
  text: string;
  /** at most 21 letters for the tile: "FAULT 12.6 m/s", "not checked: no link" */
  brief: string;
  /** ids of the checks behind this tile */
  checks: Array<string>;
}

/** A check of the same tile. */
export interface TileCheck {
  id: string;
  label: string;
  verdict: Verdict;
  text: string;
}

/** The time line of a recording. */
export interface Timeline {
  length_s: number;
  /** how far it is made */
  done_s: number;
  is_done: boolean;
  bucket_s: number;
  /** the highest of each bucket, a sketch beyond `done_s`; null: none */
  speed_mps: Array<number | null>;
  /** where nothing at all was recorded for more than a second */
  gaps: Array<[number, number]>;
  /** at most 400, the most urgent */
  marks: Array<Mark>;
  marks_left_out: number;
  kind: "timeline";
  /** what is to be said of the file */
  notes: Array<string>;
}

export interface TooLarge {
  topic: string;
  mb: number;
}

export interface TopicOffer {
  topic: string;
  type: string;
}

export interface Total {
  count: number;
  bytes: number;
}

/** `GET /api/track/points`. */
export interface TrackPoints {
  /** of the track */
  number: number;
  /** number, latitude, longitude, the server's clock [s], and how it joins the point before: 0 driven, 1 after more than 5 s without a position, 2 the position leapt */
  points: Array<[number, number, number, number, number]>;
}

export interface TrackState {
  /** another one: another track */
  number: number;
  /** number of its newest point */
  last: number;
}

/** An announcement of an alarm. */
export interface TrendMark {
  at_s: number;
  alarm: string;
  title: string;
  priority: Priority;
}

/** A signal that can be drawn. */
export interface TrendOffer {
  label: string;
  unit: string;
  /** a message of it came in this drive */
  has_data: boolean;
}

/** Steps of the last minute. */
export interface Trends {
  step_s: number;
  /** the first step since this car was dialled */
  since: number;
  /** number of the first step here */
  first: number;
  /** the moment of the frame, as a step and its part */
  now: number;
  lowest: Record<string, Array<Step>>;
  highest: Record<string, Array<Step>>;
}

/** Ends the shelving of an alarm. */
export interface UnshelveCommand {
  id?: string | null;
  kind: "unshelve";
  alarm: string;
}

export type Verdict = "ok" | "fault" | "unknown";

/** Stops a count-down: the car is not slowed by itself this time. */
export interface VetoCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "veto";
  /** as the count-down names it */
  trigger: string;
}

/** Whether the page shows scans: they are sent to no other. */
export interface Watch {
  kind: "watch";
  scan: boolean;
}

export interface Worst {
  label: string;
  value: number | null;
  unit: string;
  side: "above" | "below";
}
