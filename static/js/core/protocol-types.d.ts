// Made from server/protocol by `python -m server.protocol.reference --write`.

export interface AccelerationValue {
  acceleration_mps2: number | null;
  /** speed: derived from the speed */
  source: "topic" | "speed";
}

/** Takes control over. Refused while a line is not confirmed, or where the list is another one by now. */
export interface AcceptControlCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "accept_control";
  /** of the list that was read back, as the state names it */
  version: string;
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

/** Accepts or declines an offered item; only by the person to whom it was offered. */
export interface AnswerItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "answer_item";
  accept: boolean;
}

export type Answers = SettingsAnswer | SignalsAnswer | CheckAnswer | TrackPoints | RecordingList | LogbookAnswer | Course | VerificationAnswer | StoredList | ExportJob | DeviceList | DriveTrendsAnswer | PeopleList | InterventionAnswer | DrivingAnswer | MarkList | DepartureAnswer;

/** Slow-down may be ordered from now on. */
export interface ArmCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "arm";
}

/** What became of a command whose answer was lost. One that did not arrive yet is not carried out any more. */
export interface AskOutcomeCommand {
  id?: string | null;
  kind: "outcome";
  /** the `id` of the command */
  of: string;
  /** since it was requested, at most */
  ago_s: number;
}

/** An operator who requests control of the car and has no answer yet. */
export interface AskedControl {
  page: string;
  name: string;
  /** until silence grants it */
  left_s: number;
}

/** Why a car needs a person, and who has it. Its session alone decides. */
export interface AttentionItem {
  /** the car needs a person without a break since then */
  since_ms: number;
  assigned: ItemHolder | null;
  offered: ItemOffer | null;
  /** when it is escalated to the supervisor; null: no timer runs */
  escalates_ms: number | null;
  /** when it went on to the supervisor */
  escalated_ms: number | null;
  /** who is on duty as such now, 3 at most; null: not known, or by an older agent */
  supervisors?: Array<string> | null;
}

export interface BearingValue {
  /** counter-clockwise, 0 ahead; null: unknown */
  bearing_rad: number | null;
}

/** Begins the departure check, or begins it again: all its results are gone. */
export interface BeginDepartureCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "begin_departure";
}

/** The car stands on purpose: its alarms are marked, and only critical ones sound. It ends by itself once the car moves. */
export interface BeginPlannedStopCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "planned_stop";
  /** why it stands; another one replaces it */
  reason: "parked" | "workshop" | "charging" | "set_up";
}

/** The recording that is shown beside the one that the page replays, at its own moment. */
export interface Beside {
  kind: "beside";
  replay: ReplayState;
  state: RecordedState;
  /** remarks on the file */
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
  /** its title once it is not active; not from older agents */
  ended_title?: string;
  priority: Priority;
  state: AlarmState;
  active: boolean;
  raised_ms: number;
  /** none while it is silenced, or makes none because of a planned stop */
  sound: Sound;
  /** value against limit, as text */
  text?: string;
}

/** What the chain of a car is made of, as in LinkState and SessionState. */
export interface CarLink {
  cut: "server-bridge" | "bridge-car" | null;
  bridge_age_s: number | null;
  car_age_s: number | null;
  trying_for_s: number;
  connected_for_s: number | null;
}

/** Where a car is by its own GPS, WGS84. */
export interface CarPlace {
  lat_deg: number;
  lon_deg: number;
  /** counter-clockwise from east */
  heading_rad: number | null;
  freshness: SignalFreshness;
  age_s: number | null;
}

export interface CarSpeed {
  value_mps: number | null;
  freshness: SignalFreshness;
  age_s: number | null;
  horizon_s: number | null;
}

/** One car, as its session states it. What is not required came later: an older agent does not state it. */
export interface CarSummary {
  phase: "idle" | "connecting" | "failed" | "monitoring" | "lost";
  paused: boolean;
  link: CarLink;
  /** unacknowledged before acknowledged, then by priority, then the newest */
  worst: CarAlarm | null;
  /** alarms that nobody has acknowledged */
  waiting: number;
  /** acknowledged alarms without an owner on duty; null: none */
  unowned?: Unowned | null;
  speed: CarSpeed;
  /** name of who is in control; null: nobody */
  holder: string | null;
  /** the page that is */
  page: string | null;
  recording: "off" | "recording" | "saving" | "held" | "stopped";
  recording_for_s: number | null;
  slow_down: "not_available" | "not_armed" | "armed" | "ordered" | "holding";
  /** when it was made, by the clock that its other times are of */
  time_ms?: number;
  /** null: it needs nobody */
  attention?: AttentionItem | null;
  /** null: no position was received */
  place?: CarPlace | null;
  /** of battery or fuel */
  energy_percent?: number | null;
  /** who requests control, the oldest first, 3 at most */
  requests?: Array<AskedControl>;
  /** to whom its item can be handed over, 20 at most */
  people?: Array<PagePerson>;
  /** as `challenge` of a state */
  challenge?: string;
  /** why it stands on purpose; null: no planned stop */
  planned_stop?: "parked" | "workshop" | "charging" | "set_up" | null;
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
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  kind: "connect";
  /** host, host:port, ws://, wss:// or foxglove://; empty: the car that was configured */
  address?: string;
}

export interface ConnectionProblem {
  code: string;
  /** one sentence */
  title: string;
  /** what to do */
  hint: string;
  /** a short text under the broken node of the chain */
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
  /** who requests control, the oldest first */
  requests?: Array<ControlRequest>;
  /** null: control is not being handed over */
  handover?: HandoverState | null;
}

/** A slow-down that begins by itself, unless it is vetoed. */
export interface Countdown {
  trigger: string;
  title: string;
  text: string;
  left_s: number;
}

/** `GET /api/recordings/{id}/course`: of the whole drive of which the recording is a part. */
export interface Course {
  start_ms: number;
  length_s: number;
  /** null: not known; then `way` is empty */
  length_m: number | null;
  /** between two points of `way` */
  step_m: number;
  /** between two points of `time` */
  step_s: number;
  way: CoursePoints;
  time: CoursePoints;
  events: Array<CourseEvent>;
  /** false: the mode of the car was not recorded, in a part at least; a missing one is no zero */
  are_interventions_known: boolean;
  /** false: no log was recorded, in a part at least; the same */
  are_alarms_known: boolean;
  /** there were more than 300: `events` lacks later ones */
  are_events_cut: boolean;
  /** the speed limit at the beginning; null: not recorded */
  limit_mps: number | null;
}

/** An alarm, a mark or an intervention. */
export interface CourseEvent {
  t: number;
  m: number | null;
  /** critical · warning · advisory · mark · intervention */
  kind: string;
  text: string;
}

/** Numbers at evenly spaced places or moments; null: not known there. */
export interface CoursePoints {
  /** s since the drive began */
  t: Array<number>;
  /** distance driven */
  m: Array<number | null>;
  /** m/s */
  speed: Array<number | null>;
  /** %, negative = left */
  steering: Array<number | null>;
  /** m/s, speed minus the commanded speed */
  follow: Array<number | null>;
  /** m, error of the position as the receiver states it, one sigma */
  gps: Array<number | null>;
  lat: Array<number | null>;
  lon: Array<number | null>;
}

/** Slows the car, once armed. */
export interface DecelerateCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "slow_down";
}

/** `GET /api/departure`. */
export interface DepartureAnswer {
  done: number;
  failed: number;
  not_applicable: number;
  /** items of the list */
  of: number;
  /** none: it was not begun in this drive */
  state: "none" | "open" | "signed";
  /** who signed it, or began it */
  by: string | null;
  /** when that was */
  at_ms: number | null;
  /** null: not begun */
  check: string | null;
  items: Array<DepartureItem>;
  signature: DepartureSignature | null;
  /** the list is the one of the vehicle profile */
  is_default: boolean;
  /** why the stored list cannot be used, as a sentence */
  complaint: string | null;
  kinds: Array<DepartureKindRow>;
  /** the list as a file */
  toml: string;
}

/** One item of the list, and what became of it. */
export interface DepartureItem {
  id: string;
  title: string;
  kind: "manual" | "check" | "topic" | "recorder" | "sound" | "disk" | "clock" | "brake" | "accelerator" | "steering" | "slow_down";
  /** manual: by a person; automatic: turns by itself; active: do it, and it is seen */
  group: "manual" | "automatic" | "active";
  /** the check or the topic; "": none */
  of: string;
  /** at least so much; of a clock at most */
  need: number | null;
  unit: string;
  /** what to do where it fails */
  fix: string;
  /** due again after so many days; null: at each departure, or by distance */
  every_days: number | null;
  /** due again after so far; null: at each departure, or by time */
  every_km: number | null;
  result: "open" | "done" | "failed" | "not_applicable";
  /** what was seen */
  value: string;
  /** why it failed or is not applicable, as a person wrote it */
  note: string;
  /** who set it; null: it turned by itself, or is open */
  by: string | null;
  /** when it turned */
  at_ms: number | null;
  /** it had failed in this check */
  is_fixed: boolean;
  /** of an active item: the value now */
  now: number | null;
  /** of an active item: the highest since the check began */
  peak: number | null;
}

/** A kind of item, for who edits the list. */
export interface DepartureKindRow {
  kind: "manual" | "check" | "topic" | "recorder" | "sound" | "disk" | "clock" | "brake" | "accelerator" | "steering" | "slow_down";
  group: "manual" | "automatic" | "active";
  title: string;
  /** what `of` names; "": it has none */
  of: string;
  unit: string;
  need: number | null;
  lowest: number;
  highest: number;
}

export interface DepartureSignature {
  done: number;
  failed: number;
  not_applicable: number;
  /** items of the list */
  of: number;
  by: string;
  /** title of who is on duty; "": nobody is */
  role: string;
  at_ms: number;
  /** items that had failed first */
  fixed: number;
  /** SHA-256 of `document` [hex] */
  hash: string;
  /** canonical JSON of the list and its results; "": signed before a restart */
  document: string;
}

/** The departure check of this drive, in short. */
export interface DepartureState {
  done: number;
  failed: number;
  not_applicable: number;
  /** items of the list */
  of: number;
  /** none: it was not begun in this drive */
  state: "none" | "open" | "signed";
  /** who signed it, or began it */
  by: string | null;
  /** when that was */
  at_ms: number | null;
}

/** Describes why somebody intervened; sent again it replaces the description before. */
export interface DescribeInterventionCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "describe_intervention";
  /** its id, as the state names it */
  intervention: string;
  /** as text; empty where the category is enough */
  what?: string;
  category?: string | null;
  /** where the data show another one; null: as they show */
  initiated_by?: "driver" | "operator" | "system" | "unknown" | null;
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
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "disarm";
}

/** Ends monitoring: the session is idle. */
export interface DisconnectCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  kind: "disconnect";
}

export interface DistanceValue {
  /** null: none in range */
  distance_m: number | null;
  none_in_range: boolean;
}

/** One moment that somebody marked. */
export interface DriveMark {
  /** the mark's id */
  mark: string;
  /** the moment that was marked, by the server's clock */
  marked_ms: number;
  category: string | null;
  /** text on the moment; "": none */
  words: string;
  /** a voice note belongs to it */
  voice: boolean;
  /** a photo belongs to it */
  photo: boolean;
  /** what marked: a page, a program, or the car's own button */
  source: "page" | "http" | "car";
  by: string | null;
  /** of a recording: since it began */
  at_s?: number;
  /** of a recording: it came, or was changed, after the recording was complete */
  late?: boolean;
}

/** The car at one moment about an intervention. */
export interface DriveSample {
  /** since the intervention; negative: before it */
  at_s: number;
  /** null: not known */
  speed_mps: number | null;
  /** null: not known */
  brake_percent: number | null;
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

/** A time in one mode. */
export interface DrivenSpan {
  /** autonomous · manual · unknown */
  mode: string;
  from_s: number;
  to_s: number;
}

/** `GET /api/driving`: totals since this car was dialled. */
export interface DrivingAnswer {
  /** time and distance in each mode */
  modes: Record<string, ModeTotal>;
  interventions: number;
  alarms: number;
  per_km: PerKilometre;
}

/** Who is on duty at this device: after the page's hello, and whenever it changes. */
export interface Duty {
  kind: "duty";
  /** null: not signed on */
  me: DutyState | null;
  /** the name under which this page's orders are logged */
  signs: string;
  /** shown until it is dismissed, or somebody signs on */
  ended: DutyEnded | null;
  /** how many are in the list of people; 0: nobody can sign on */
  people: number;
  /** everybody, at whatever device */
  on_duty: Array<DutyState>;
}

/** How the last duty at this device ended. */
export interface DutyEnded {
  /** one sentence */
  text: string;
  at_ms: number;
}

/** A person who is on duty. */
export interface DutyState {
  /** id in the list of people */
  person: string;
  name: string;
  role: "operator" | "safety_driver" | "supervisor" | "test_engineer";
  /** of the role */
  title: string;
  /** name of the device at which they signed on */
  device: string;
  since_ms: number;
}

/** Declines the offer, or takes it back: by who takes over, or by who offered. */
export interface EndOfferCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "end_offer";
}

/** Ends the planned stop. */
export interface EndPlannedStopCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "end_planned_stop";
}

/** Events of the log, at most 400. */
export interface Events {
  kind: "events";
  events: Array<LogEvent>;
  /** the newest number there is */
  last: number;
  /** with the first ones for a page whose hello names another run; then there may be none */
  resumed?: Resumed;
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

/** To a page of all cars: what happened to the item of one, the newest 20 first, then each new one. */
export interface FleetEvent {
  kind: "fleet_event";
  vehicle: string;
  /** its number in the log of the car */
  n: number;
  time_ms: number;
  text: string;
  /** who did it, where a person did */
  by: string | null;
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

/** For the web node: control was handed over, so who had it is not on duty there any more. */
export interface HandedOver {
  /** under which somebody was on duty */
  device: string;
  to: string;
  /** of `outcome`: how long ago */
  ago_s?: number;
}

/** One thing that stands, to be read back. */
export interface HandoverLine {
  key: string;
  kind: "alarm" | "shelved" | "limit" | "rides" | "driving" | "departure" | "slow_down" | "paused" | "planned_stop";
  title: string;
  text: string;
  /** of an alarm */
  priority: Priority | null;
  since_ms: number | null;
  /** of an acknowledged alarm: when the duty of its owner ended; null: on duty, or not known */
  off_duty_ms?: number | null;
  /** of what is shelved */
  until_ms: number | null;
  /** who takes over has confirmed it */
  read: boolean;
}

/** Control is being handed over: it changes once every line is read back. */
export interface HandoverState {
  by: string;
  by_page: string;
  /** who takes over */
  name: string;
  page: string;
  since_ms: number;
  lines: Array<HandoverLine>;
  /** lines that are not confirmed */
  left: number;
  /** of the list */
  version: string;
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
  /** another one: another run of the server; numbers of events are of a run */
  boot: string;
  /** of the server that the page reached; times of another one may be of another clock */
  run: string;
  vehicle: string;
  vehicles: Array<string>;
  /** of the page that the server has now; "" for single modules */
  build: string;
  time_ms: number;
  last_event: number;
  /** without a message for so long a page covers its values */
  veil_after_s: number;
  /** a page whose hello names another run gets `resumed` */
  resumes?: boolean;
  /** of a web node: orders are signed, as agents require it */
  signs?: boolean;
  who: Identity;
  /** for the next socket of this device, until 10 minutes after the end of its last one; "": none is needed */
  ticket: string;
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

/** `GET /api/interventions/{intervention}`. */
export interface InterventionAnswer {
  id: string;
  at_ms: number;
  kind_of: "to_manual" | "brake" | "steer";
  speed_mps: number;
  lat_deg: number | null;
  lon_deg: number | null;
  initiated_by: "driver" | "operator" | "system" | "unknown";
  /** the most, where the brake was pressed against the command */
  brake_percent: number | null;
  /** brake or wheel so long before the mode changed */
  acted_before_s: number | null;
  /** titles of the alarms that were active, at most 20 */
  active: Array<string>;
  /** since the newest alarm before it began; null: none, or not known */
  last_alarm_ago_s: number | null;
  /** from 10 s before to 6 s after; of before a restart: no later ones */
  samples: Array<DriveSample>;
  /** as it was described last; null: not yet */
  what: string | null;
  category: string | null;
  described_by: string | null;
  /** interventions that nobody has described yet */
  left: number;
}

/** Who has the item of a car in the attention queue. */
export interface ItemHolder {
  name: string;
  page: string;
  since_ms: number;
}

/** To whom the item is offered; it stays where it is until they accept. */
export interface ItemOffer {
  by: string;
  name: string;
  page: string;
  since_ms: number;
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
  /** when the last data came from beyond the cut */
  since_ms: number | null;
  /** since the last data of the bridge; null: none */
  bridge_age_s: number | null;
  /** since the last data of the car; null: none */
  car_age_s: number | null;
  /** may be there while cut is null: a part behind the bridge failed, and messages still come */
  problem: ConnectionProblem | null;
  attempts: number;
  trying_for_s: number;
  topics_subscribed: number;
  topics_heard: number;
  /** how old messages are when they come, estimated, at most 0.2 s too little; null: not known */
  late_s: number | null;
  /** how old messages are when they come, at most; null: not known */
  most_late_s: number | null;
  /** what is not requested in full because the link is slow, as a sentence */
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
  /** which part is silent, as a sentence; null: none */
  trouble?: string | null;
  /** who declared a silent car off; null: nobody */
  off?: OffOnPurpose | null;
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
  /** as `challenge` of a live state */
  challenge?: string;
}

/** One event of the log. */
export interface LogEvent {
  /** who was on duty at the device that did it; left out: nobody */
  person?: string;
  /** of that person */
  role?: "operator" | "safety_driver" | "supervisor" | "test_engineer";
  /** what happened to control, or to the item; below */
  act?: string;
  by_page?: string | null;
  /** who is in control now, or to whom the item is assigned */
  holder?: string | null;
  page?: string | null;
  /** the one before, where that is another; of an intervention: the 10 s before it, twice a second */
  before?: string | Array<DriveSample> | null;
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
  mode?: "autonomous" | "manual" | "unknown";
  /** the topic, "commands" or "" */
  mode_source?: string;
  /** when it happened; it is logged a moment later */
  moment_ms?: number;
  /** single changes of a mode that flickers, which are not events of their own */
  flickers?: number;
  /** its id */
  intervention?: string;
  kind_of?: "to_manual" | "brake" | "steer";
  speed_mps?: number | null;
  lat_deg?: number | null;
  lon_deg?: number | null;
  initiated_by?: "driver" | "operator" | "system" | "unknown";
  /** ids of the alarms that were active */
  active?: Array<string>;
  brake_percent?: number | null;
  /** brake or wheel so long before the mode changed */
  acted_before_s?: number | null;
  /** the description of an intervention */
  what?: string;
  /** id of the departure check */
  check?: string;
  /** id of the item that turned */
  item?: string;
  item_title?: string;
  result?: "open" | "done" | "failed" | "not_applicable";
  /** what was seen */
  value?: string;
  note?: string;
  /** items of the departure check; so are `failed`, `not_applicable` and `of` */
  done?: number;
  failed?: number;
  not_applicable?: number;
  of?: number;
  /** items that had failed first */
  fixed?: number;
  /** of a signed departure check: its items that have an interval */
  recurring?: Array<RecurringItem>;
  /** SHA-256 of the list and its results [hex]; with an item: of its question */
  hash?: string;
  /** under whose name alarms were acknowledged */
  owner?: string;
  /** when their duty ended; null: they are on duty again */
  off_duty_ms?: number | null;
  address?: string;
  /** all that are in force, as monitoring begins */
  settings?: Record<string, any>;
  /** name of a setting → from, to */
  changes?: Record<string, Array<any>>;
  /** the recording that was recovered */
  recording?: string;
  /** the phone that was chosen */
  phone?: string | null;
  /** when the pause or the planned stop began */
  since_ms?: number;
  /** of a planned stop */
  reason?: "parked" | "workshop" | "charging" | "set_up";
  /** monitoring continues after a restart of the server: the drive is the same */
  resumes?: boolean;
  /** the mark's id */
  mark?: string;
  /** the moment that was marked, by the server's clock */
  marked_ms?: number;
  category?: string | null;
  /** text on the moment; "": none */
  words?: string;
  /** a voice note belongs to it */
  voice?: boolean;
  /** a photo belongs to it */
  photo?: boolean;
  /** what marked: a page, a program, or the car's own button */
  source?: "page" | "http" | "car";
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
  /** it happened in a planned stop, for this reason */
  planned_stop?: "parked" | "workshop" | "charging" | "set_up";
  measured?: Quantity | null;
  limit?: Quantity | null;
  /** furthest beyond its limit since it was raised */
  worst?: Worst | null;
  /** its number: grows by one, never given twice */
  n: number;
  /** the log had lost it, and it was brought back from this recording */
  brought_from?: string;
  /** it follows the log without a gap, and the server was killed then: state is restored from it too */
  was_cut?: boolean;
}

/** `GET /api/logbook`. */
export interface LogbookAnswer {
  totals: LogbookTotals;
  weeks: Array<LogbookWeek>;
  /** alarms by what they are about, most first */
  components: Record<string, number>;
  /** the newest 200, newest first; the CSV has all */
  drives: Array<LogbookDrive>;
  /** to choose among */
  people: Array<string>;
  /** of each car, over all its drives */
  checks: Array<LogbookCheck>;
  /** recordings that are yet to be read: their drives are missing */
  unread: number;
}

/** The newest signed departure check of a car, whatever drives were requested. */
export interface LogbookCheck {
  vehicle: string;
  /** null: no drive has one */
  signed_ms: number | null;
  by: string;
  /** items that had failed when it was signed */
  failed: number;
  /** as far as the recording names them */
  failed_items: Array<string>;
  /** driven since, the drive it was made for among it; null: not known */
  distance_m: number | null;
  /** of those drives, whose distance is not known: it was farther */
  unmeasured: number;
  /** since, without a signed check: that for which it was made is none of them */
  drives: number;
  /** of those, whose recording does not say whether they were checked */
  not_known: number;
  /** items with an interval, as the newest signed list has them; most late first */
  recurring: Array<LogbookDue>;
}

/** One drive; its parts are recordings of one session, and of those that went on after a restart of the server. */
export interface LogbookDrive {
  /** of its first recording */
  id: string;
  parts: number;
  /** its parts, oldest first */
  recordings: Array<string>;
  vehicle: string;
  started_ms: number;
  title: string;
  tags: Array<string>;
  /** who was on duty, or gave an order */
  people: Array<string>;
  /** null: neither positions nor a speed */
  distance_m: number | null;
  /** how long was recorded */
  driven_s: number;
  /** by autonomous, manual, unknown */
  modes_m: Record<string, number | null>;
  modes_s: Record<string, number>;
  /** null: the mode of the car was not recorded, in a part at least */
  interventions: number | null;
  /** interventions that nobody has described; null: not known */
  undescribed: number | null;
  /** raised; null: no log was recorded, in a part at least */
  alarms: number | null;
  /** those that came later too */
  marks: number | null;
  /** without a message for longer than 1 s, all together */
  blind_s: number;
  /** the departure check; null: not known */
  departure: "none" | "open" | "signed" | null;
  /** when it was signed */
  departure_ms: number | null;
  /** who signed; "": not signed, or not known */
  departure_by: string;
  /** items that had failed when it was signed */
  departure_failed: number;
  /** those, as far as the recording names them; at most 20 */
  failed_items: Array<string>;
  /** items of the signed check that have an interval */
  recurring: Array<RecurringItem>;
  /** alarms by what they are about */
  components: Record<string, number>;
}

/** When an item of the departure check that has an interval is due again. */
export interface LogbookDue {
  item: string;
  title: string;
  every_days: number | null;
  every_km: number | null;
  /** the newest signed check in which it was done; null: in none */
  done_ms: number | null;
  /** driven since; null: not known, or never done */
  distance_m: number | null;
  /** it was farther: the distance of a drive since is not known */
  is_least: boolean;
  /** whole days left, negative: late; null: not due by time, or never done */
  due_days: number | null;
  /** distance left, negative: late; null: not due by distance, or not known */
  due_km: number | null;
  /** late by time or distance, or never done */
  is_overdue: boolean;
}

/** Over all drives that were requested. */
export interface LogbookTotals {
  drives: number;
  distance_m: number;
  driven_s: number;
  modes_m: Record<string, number>;
  modes_s: Record<string, number>;
  /** per 100 km that the car drove by itself, over the drives that know their mode */
  interventions: number | null;
  /** per 100 km, over the drives with a log */
  alarms: number | null;
  /** drives without a signed departure check */
  checks_missing: number;
  /** of so many drives */
  checks_known: number;
}

/** A week from Monday, UTC. */
export interface LogbookWeek {
  from_ms: number;
  drives: number;
  modes_m: Record<string, number>;
  /** per 100 km that the car drove by itself; null: not known, or less than 100 m of it */
  interventions: number | null;
  /** per 100 km of all; null: the same */
  alarms: number | null;
  /** of this and the four weeks before, without a week of no drives */
  interventions_median: number | null;
  alarms_median: number | null;
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

/** Marks, the newest moment last. */
export interface MarkList {
  marks: Array<DriveMark>;
}

export type Message = Hello | Offer | State | Cars | Events | Reply | Problem | Timeline | Beside | BesideEnded | ReplayEnded | Unserved | FleetEvent | Duty;

/** Who drives. */
export interface ModeState {
  mode: "autonomous" | "manual" | "unknown";
  /** why it is unknown; null: it is known */
  why: "no_source" | "silent" | "flickers" | "unclear" | null;
  /** null: nothing was known before, or of a recording */
  since_ms: number | null;
  /** driven in this mode since then; null: not known */
  way_m: number | null;
  /** the topic; "commands": by the rule; "": none */
  source: string;
  /** to be described, the oldest first, at most 20 */
  open: Array<OpenIntervention>;
}

export interface ModeTotal {
  s: number;
  m: number;
}

export interface ModeValue {
  /** of a plain number always unknown: what it means is a setting */
  mode: "autonomous" | "manual" | "unknown";
  /** as the car states it */
  said: string;
}

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

/** A person declared a car off; it holds until the car's agent sends data again. */
export interface OffOnPurpose {
  by: string;
  since_ms: number;
}

/** Something newer than the page has. */
export interface Offer {
  kind: "offer";
  seq: number;
  of: Array<"state" | "scan" | "timeline" | "cars" | "beside">;
  /** when the page's last take was received; before the first, when it connected */
  took_ms: number;
  /** its number `n`; 0: it had none, or there was none yet */
  took?: number;
}

/** Offers control to another page, whose operator reads back what is in force; until then control stays where it is. */
export interface OfferControlCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "offer_control";
  /** the page that is to get it */
  to: string;
}

/** Offers the car's item to another person; it stays assigned as it is until they accept. */
export interface OfferItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "offer_item";
  /** the page of that person, as `people` of the summary names it */
  to: string;
}

/** Opens a second recording beside the one that is replayed, to compare both. */
export interface OpenBeside {
  kind: "replay";
  id?: string | null;
  do: "beside";
  recording: string;
  at_s?: number;
}

/** An intervention that nobody has described yet. */
export interface OpenIntervention {
  id: string;
  at_ms: number;
  kind_of: "to_manual" | "brake" | "steer";
}

/** Opens a recording by its id, at a moment [s since its beginning]. `topics` (signal → topic) and `units` (signal → name) are chosen for this replay, before those that were recorded. */
export interface OpenReplay {
  kind: "replay";
  id?: string | null;
  do: "open";
  recording: string;
  at_s?: number;
  topics?: Record<string, string>;
  units?: Record<string, string>;
}

/** One answer to a question. */
export interface Option {
  /** what the command `set` takes for it: a topic, or the name of a unit */
  value: string;
  /** as the page shows it */
  label: string;
  /** what is known of it; empty: nothing */
  why: string;
}

/** When; null: not (yet). */
export interface OrderSteps {
  pressed_ms: number | null;
  server_ms: number | null;
  bridge_ms: number | null;
  slows_ms: number | null;
}

/** Before everything else but `take`: the server then sends what the page missed, and no event before it (or 10 s after the connection, where none comes). A command that comes before it is refused, also that of a client which sends no hello; a `present` that comes before it does not count. */
export interface PageHello {
  kind: "hello";
  /** number of the newest event that the page has */
  have_event?: number | null;
  /** of the run that it is of */
  boot?: string | null;
  /** what its operator calls it */
  name?: string;
  /** which page it is; "" for single modules. With `page` and without it: former names of phases */
  build?: string;
  /** what it calls itself, kept over reloads; without it the server gives it one */
  page?: string;
}

export type PageMessage = PageHello | Take | Have | Watch | OpenReplay | OpenBeside | CloseBeside | LeaveReplay | SeekReplay | PlayReplay | PauseReplay | SetReplayRate | SeekReplayAlarm | ConnectCommand | RetryCommand | DisconnectCommand | PauseCommand | ResumeCommand | RecordCommand | AcknowledgeCommand | SilenceCommand | ShelveCommand | UnshelveCommand | SetCommand | ImportCommand | PositionCommand | RideCommand | TakeControlCommand | TakeItemCommand | ReleaseItemCommand | OfferItemCommand | AnswerItemCommand | WithdrawItemCommand | OfferControlCommand | ReadBackCommand | AcceptControlCommand | EndOfferCommand | TakeAlarmCommand | PlaceMarkCommand | RemoveMarkCommand | BeginDepartureCommand | SetDepartureItemCommand | SignDepartureCommand | ReopenDepartureCommand | SetDepartureListCommand | ArmCommand | DisarmCommand | DecelerateCommand | ReleaseCommand | VetoCommand | DescribeInterventionCommand | BeginPlannedStopCommand | EndPlannedStopCommand | PresentWordCommand | AskOutcomeCommand;

/** An operator's page that announces the alarms of this car. */
export interface PagePerson {
  page: string;
  name: string;
}

/** One page of an operator. */
export interface PagePresence {
  page: string;
  name: string;
  /** an alarm would be audible on it now */
  can: boolean;
  /** silent: no contact for 3 s; blind: it receives nothing for 2 s; undrawn: its drawing failed */
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
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
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

/** The answer of `GET /api/people`, and of each change. */
export interface PeopleList {
  people: Array<PersonRow>;
  roles: Array<RoleRow>;
  /** a duty ends by itself after so long */
  ends_after_h: number;
  /** id of the new person, where one was added */
  added?: string;
  me: DutyState | null;
}

export interface PerKilometre {
  /** on a kilometre driven by itself; null: no such distance */
  interventions: number | null;
  /** announced, on a kilometre; null: no distance */
  alarms: number | null;
}

/** One of the list of people. */
export interface PersonRow {
  id: string;
  name: string;
  /** of the last time */
  role: "operator" | "safety_driver" | "supervisor" | "test_engineer";
  /** when they signed on last; null: never */
  last_ms: number | null;
  /** null: not on duty */
  duty: DutyState | null;
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

/** Marks a moment. The same `mark` again changes what is given; without any change nothing happens. */
export interface PlaceMarkCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "mark";
  /** its id, made up by who marks; the same again changes it */
  mark: string;
  at_ms?: number | null;
  age_ms?: number | null;
  category?: string | null;
  words?: string | null;
}

/** The car stands on purpose: its alarms are marked. */
export interface PlannedStopState {
  reason: "parked" | "workshop" | "charging" | "set_up";
  by: string | null;
  since_ms: number;
  /** false: it does not end by itself until the speed is known */
  is_speed_known: boolean;
}

/** Resumes; from the beginning where it is at the end. */
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

/** The state of a page, once a second and at each change: whether it is seen, and whether an alarm would sound from it. Nothing answers it but its refusal. */
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
  /** id of the key by which the page signs its orders */
  key?: string | null;
  /** it is closed, or another page takes its place */
  leaves?: boolean;
  /** the other cars whose next alarm would sound from it */
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

/** Open until it is answered by the command `set`: `topics` of a source, `units` of a unit. */
export interface Question {
  signal: string;
  kind: "source" | "unit";
  /** *Two lasers: which one faces forward?* */
  words: string;
  /** the most probable first, at most 12 */
  options: Array<Option>;
  /** how many there are, those left out included */
  options_count: number;
}

export interface RaisedAlarm {
  at_ms: number;
  priority: Priority;
  alarm: string;
  title: string;
  text: string;
}

/** On the pages of how many operators an alarm would sound now. */
export interface ReachState {
  can: number;
  of: number;
  /** why the others would not */
  why: string;
  /** at most 12; a page silent for 5 min is forgotten */
  pages: Array<PagePresence>;
  left_out: number;
}

/** Confirms one line of what is in force; only by who takes over. */
export interface ReadBackCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "read_back";
  /** its key, as the state names it */
  line: string;
  /** false: taken back */
  is_read?: boolean;
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
  /** who drives */
  mode: ModeState;
  control: ControlState;
  /** whom an alarm would reach; null: of a recording */
  reach: ReachState | null;
  /** the phone that is compared with the car; null: none */
  phone: PhoneCompared | null;
  /** all that share a position, at most 12, the one compared first */
  phones: Array<PhoneListed>;
  /** how many marks this drive has, or a recording up to the moment shown */
  marks: number;
  /** open questions to the operator in control of this car, the most urgent first */
  questions: Array<Question>;
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
  /** for the report of the drive; "": nobody entered it */
  weather: string;
  tags: Array<string>;
  /** how many; a search covers their texts */
  marks: number;
  /** of a search by text: the first mark whose text or category has it */
  matched?: DriveMark;
  /** another value: other marks or descriptions came after it was complete; left out: none did */
  late?: string;
  /** of one recording: those that came after it was complete, at most 200 */
  late_marks?: Array<DriveMark>;
  /** waiting: listed by its name, and read soon */
  state: "waiting" | "read" | "unreadable";
  /** why it cannot be read, as a sentence */
  problem: string | null;
  /** what of it cannot be read, a sentence each */
  damage: Array<string>;
  /** topics whose messages are of no use here, a sentence each; at most 10 */
  unread: Array<string>;
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
  /** mcap · bag · db3 · zstd · folder */
  format: string;
  /** why no single file is a copy of it, as text behind “it is”; null: its file is all of it */
  several_files: string | null;
  sha256: string | null;
  /** SHA-256 of the last record of its hash chain [hex], not verified; null: none */
  head: string | null;
  /** null: this file was not verified since the server started */
  verified: VerificationAnswer | null;
  thumbnail: string;
  /** null: no position */
  sketch: SketchAnswer | null;
  trashed_ms: number | null;
  /** where the server has a store */
  stored?: StoredCopy;
  /** of a recording that is requested alone; at most 200 */
  raised?: Array<RaisedAlarm>;
  /** of a recording that is requested alone: the highest speed of at most 361 equal parts; empty: none */
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
  /** where the server has one */
  store?: StoreFacts;
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
  /** saving: being completed; held: link lost, it continues if that returns in time; stopped: it was to record and cannot */
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

/** An item that has an interval, as a check was signed. */
export interface RecurringItem {
  item: string;
  title: string;
  /** due again after so long; null: no matter how long */
  every_days: number | null;
  /** due again after so far; null: no matter how far */
  every_km: number | null;
  is_done: boolean;
}

export interface RefusedAddress {
  code: string;
  /** one sentence */
  title: string;
  /** what to do */
  hint: string;
  /** a short text under the broken node of the chain */
  mark: string;
  /** an address that would do */
  suggestion: string | null;
}

/** Ends the order, or the guard's hold, of this number: the driver, or the car, may drive on. */
export interface ReleaseCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "release";
  /** of the very order that ends, as the state names it */
  number: number;
}

/** Gives the car's item back to the queue; only by who has it. */
export interface ReleaseItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "release_item";
}

/** Takes a mark back. */
export interface RemoveMarkCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "remove_mark";
  /** the id of the mark */
  mark: string;
}

/** Takes the signature back; the results stay. */
export interface ReopenDepartureCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "reopen_departure";
}

/** The page's replay is over, or could not begin; what follows is live. */
export interface ReplayEnded {
  kind: "replay";
  /** one sentence */
  ended: string;
}

/** An intervention in a recording. */
export interface ReplayIntervention {
  at_s: number;
  /** as of the event; of another version it may be another value */
  kind_of: string;
  category: string | null;
  /** its description, also one that came later; "" and no category: nobody described it */
  what: string;
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
  /** for requests of trends and track */
  token: string;
  /** its process has sent nothing for so long */
  hangs_s: number | null;
}

/** The answer to one command. */
export interface Reply {
  ok: boolean;
  /** of one that is not ok: refused where left out; not_delivered: it never will be; unknown: it may be */
  outcome?: "refused" | "not_delivered" | "unknown";
  /** where it was lost, where known */
  cut?: "server-broker" | "broker-agent" | "agent-car" | null;
  /** of `outcome`; never: nor will it be */
  became?: "done" | "refused" | "never" | "under_way" | "not_known";
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
  /** what is in force now, where a read-back was refused */
  handover?: HandoverState | null;
  /** not sent to pages */
  handed_over?: HandedOver;
  /** who is in control instead */
  held_by?: string | null;
  kind: "reply";
  /** of the command */
  id: string;
}

/** Ends the pause. */
export interface ResumeCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  kind: "resume";
}

/** How the log continues for a page that read it in another run. */
export interface Resumed {
  /** up to this number it is the log that the page has; what the page has beyond is not in it */
  common: number;
  /** events after this number are new; those up to it may be known from another log */
  new_after: number;
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

export interface RoleRow {
  role: "operator" | "safety_driver" | "supervisor" | "test_engineer";
  title: string;
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
  /** of the rear axle, by the transforms; null: as the setting has it */
  laser_ahead_m?: number | null;
  /** of the centre line */
  laser_left_m?: number | null;
  /** *laser assumed to look ahead*, *gap from the laser: no bumper set*: limits of its view of the road */
  mounting?: string | null;
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
  /** of an agent: what a device signs with its next order */
  challenge?: string;
  /** of a web node: the state was likely made so long after `time_ms` */
  excess_ms?: number;
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
  /** null: there is none; not from older agents */
  planned_stop?: PlannedStopState | null;
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
  /** in SI; null restores the default */
  values?: Record<string, number | null>;
  /** signal → topic; null: as found */
  topics?: Record<string, string | null>;
  /** signal → name of its unit; null: as found */
  units?: Record<string, string | null>;
  /** a profile's name, or auto */
  profile?: string | null;
  /** refused where the settings are no longer at this version */
  version?: number | null;
}

/** A person's result of one item; refused where it turns by itself, or the check is signed. */
export interface SetDepartureItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "set_departure_item";
  item: string;
  /** open: taken back */
  result: "open" | "done" | "failed" | "not_applicable";
  /** why; required of failed and not_applicable */
  note?: string;
}

/** Replaces the list of the car; an item with the same question as before keeps its result. */
export interface SetDepartureListCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "set_departure_list";
  /** as in the file; null: the list of the vehicle profile again */
  items: Array<Record<string, any>> | null;
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
  /** signal → name of its unit, of those that were chosen */
  units: Record<string, string>;
  /** signal → the units it may be published in */
  unit_choices: Record<string, Array<UnitChoice>>;
  /** in the order of Settings */
  schema: Record<string, SettingField>;
}

/** Hides an alarm for a time. */
export interface ShelveCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  kind: "shelve";
  alarm: string;
  occurrence: number;
  minutes?: number;
}

/** Signs the check; refused while an item is failed or open, or where it is another check by now. */
export interface SignDepartureCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "sign_departure";
  /** its id, as the page shows it */
  check: string;
}

export type SignalFreshness = "fresh" | "ageing" | "stale" | "not_measured" | "no_value" | "never" | "not_published";

/** One signal. */
export interface SignalState<Value> {
  label: string;
  /** of the headline number; empty: it has none, or its unit is not known */
  unit: string;
  /** ageing: > 3 periods; stale: > max(10 periods, 1 s); not_measured: messages came, which declare that; no_value: messages came, none of which could be used; never: subscribed to, and nothing came */
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
  /** why this topic carries the signal; null: none does */
  why: string | null;
  /** the frame that its messages name; null: none, or not known */
  frame: string | null;
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
  mode: SignalState<ModeValue>;
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
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
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
  /** false: its commands are not sent; it continues when the link is back, if it is not released */
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
  state: "not_available" | "not_armed" | "armed" | "ordered" | "holding";
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
  /** its title once it is not active; not from older agents */
  ended_title?: string;
  priority: Priority;
  /** where it is shown now */
  place: Place;
  /** none: it makes no sound because of a planned stop */
  sound: Sound;
  /** the car stands on purpose; not from older agents */
  planned_stop?: boolean;
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
  /** when the duty of who acknowledged it ended; null: on duty, or not known */
  off_duty_ms?: number | null;
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
  /** who drives */
  mode: ModeState;
  control: ControlState;
  /** whom an alarm would reach; null: of a recording */
  reach: ReachState | null;
  /** the phone that is compared with the car; null: none */
  phone: PhoneCompared | null;
  /** all that share a position, at most 12, the one compared first */
  phones: Array<PhoneListed>;
  /** how many marks this drive has, or a recording up to the moment shown */
  marks: number;
  /** open questions to the operator in control of this car, the most urgent first */
  questions: Array<Question>;
  server: ServerState;
  /** the departure check; left out of a recording's state */
  departure?: DepartureState;
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

/** The store of a server. */
export interface StoreFacts {
  address: string;
  /** why nothing is uploaded now, as a sentence */
  problem: string | null;
}

export interface StoredClip {
  name: string;
  /** the alarm it is about */
  at_ms: number;
  size_bytes: number;
}

/** The copy of a recording in the store. */
export interface StoredCopy {
  /** of the whole file */
  state: "none" | "waiting" | "uploading" | "stored" | "failed";
  /** of the whole file that is in the store, 0 to 1; null: none is being uploaded */
  share: number | null;
  /** when the copy was read back and was the same */
  checked_ms: number | null;
  /** why it is not there, or why it failed; empty: nothing to say */
  sentence: string;
  /** clips around alarms that are in the store */
  clips: number;
  /** a person's request stands, which can be taken back */
  is_asked: boolean;
  /** it is deleted here once the copy was read back, by request or setting */
  is_deletion_asked: boolean;
}

/** `GET /api/stored`. */
export interface StoredList {
  store: string;
  recordings: Array<StoredRecording>;
  /** the `cursor` of the page after this one */
  next: string | null;
  count: number;
}

/** A row of `GET /api/stored`, as the agent wrote it into the store. */
export interface StoredRecording {
  id: string;
  vehicle: string;
  /** of the vehicle, in addresses */
  folder: string;
  title: string;
  started_ms: number;
  length_s: number | null;
  distance_m: number | null;
  top_speed_mps: number | null;
  alarms: Record<string, number> | null;
  sketch: SketchAnswer | null;
  /** its name, if the whole file is stored and was verified */
  file: string | null;
  /** of the whole file in the store */
  size_bytes: number | null;
  sha256: string | null;
  checked_ms: number | null;
  clips: Array<StoredClip>;
}

/** Not announced, because others explain it. */
export interface SuppressedAlarm {
  id: string;
  title: string;
  priority: Priority;
  /** titles of the alarms that explain it */
  by: Array<string>;
  raised_ms: number | null;
}

/** Takes what was offered, or states that a state came which was sent ahead. */
export interface Take {
  kind: "take";
  /** of the offer; 0: of none */
  seq: number;
  /** counts the takes of a connection from 1 on */
  n?: number;
  /** so many states may be under way, sent without an offer; at most 12 */
  ahead?: number;
  /** with `ahead`: how many states this connection has brought */
  got?: number;
}

/** Makes who sends it the owner of an acknowledged alarm; refused unless the duty of its owner has ended, and from where nobody is on duty while people sign on at all. */
export interface TakeAlarmCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "take_alarm";
  alarm: string;
  /** which occurrence was read; an older one is refused */
  occurrence: number;
}

/** Takes, gives or requests control; server/control/lease.py has the rules. */
export interface TakeControlCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
  kind: "control";
  do: "take" | "take_over" | "release" | "request" | "withdraw" | "hand_over" | "keep";
  /** of hand_over: the page that gets it; of keep: whose request is refused */
  to?: string | null;
}

/** Assigns the car's item to who sends it; refused where it is assigned to another, or the car needs nobody. */
export interface TakeItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "take_item";
  /** true: also from another */
  over?: boolean;
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
  /** of its alarm; absent from agents before 2026-12 */
  priority?: Priority;
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
  /** moments that somebody marked, oldest first; at most 400, texts shortened */
  flags: Array<DriveMark>;
  /** oldest first, at most 400 */
  interventions: Array<ReplayIntervention>;
  /** who drove when, without a gap, at most 400; empty: not recorded */
  modes: Array<DrivenSpan>;
  /** remarks on the file */
  notes: Array<string>;
}

export interface TooLarge {
  topic: string;
  mb: number;
}

export interface TopicOffer {
  topic: string;
  type: string;
  /** that its messages name; null: none, or not known */
  frame?: string | null;
  /** evidence for and against it, as a short text */
  why?: string;
  /** of a laser that is compared: the nearest range in each of at most 72 parts of its newest scan */
  ranges_m?: Array<number | null>;
  /** of the middle of the first part, in the laser's own frame */
  angle_min_rad?: number;
  /** from one part to the next */
  angle_increment_rad?: number;
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

export interface UnitChoice {
  name: string;
  label: string;
}

/** Alarms that were acknowledged by people whose duty has ended since. */
export interface Unowned {
  count: number;
  /** whose duty ended first */
  by: string;
  /** when it ended */
  since_ms: number;
}

/** Of web nodes, twice a second while nothing comes from the vehicle's session; over with the next state. */
export interface Unserved {
  kind: "unserved";
  /** one sentence */
  why: string;
}

/** Ends the shelving of an alarm. */
export interface UnshelveCommand {
  id?: string | null;
  kind: "unshelve";
  alarm: string;
}

export type Verdict = "ok" | "fault" | "unknown";

/** Whether a recording is as it was recorded. */
export interface VerificationAnswer {
  /** unfinished: it ends before its seal; no chain: recorded by an older version */
  state: "intact" | "broken" | "unfinished" | "no chain" | "unreadable";
  /** broken or unfinished, or a recording beside it names another hash */
  is_broken: boolean;
  /** a short text, as *Intact · 3f9a12bc* or *Broken at record 57* */
  short: string;
  sentence: string;
  records: number;
  /** SHA-256 of the last record [hex]; null: there is none, or it is broken */
  head: string | null;
  broken: VerificationBreak | null;
  /** the recorder was interrupted, and the file completed later */
  is_recovered: boolean;
  /** the recording that it names as the one before it */
  previous: string | null;
  previous_missing: boolean;
  /** what recordings beside it object, a sentence each */
  problems: Array<string>;
  /** when it was verified */
  at_ms: number;
}

/** Where a hash chain breaks: the record whose hash does not hold, and what it covers. */
export interface VerificationBreak {
  record: number;
  from_byte: number;
  to_byte: number;
  /** ns since 1970; 0: not known */
  from_ns: number;
  to_ns: number;
}

/** Stops a count-down: the car is not slowed by itself this time. */
export interface VetoCommand {
  id?: string | null;
  /** since the finger let go, when it was sent */
  pressed_ago_s?: number;
  heard_ms?: number | null;
  held_s?: number;
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

/** Takes an offer back; only by who made it. */
export interface WithdrawItemCommand {
  id?: string | null;
  /** the car that the page named to its operator; refused by any other */
  vehicle?: string | null;
  kind: "withdraw_item";
}

export interface Worst {
  label: string;
  value: number | null;
  unit: string;
  side: "above" | "below";
}
