"""The state frame: the whole state of a vehicle, or of a recording at one moment."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypeAliasType, TypedDict

from monitor.planned_stop import StopReason
from monitor.shell_facts import Phase
from server.protocol.alarm_state import AlarmLoad, StandingAlarm, SuppressedAlarm, Tile
from server.protocol.departure import DepartureState
from server.protocol.doc import doc
from server.protocol.driving_state import ModeState
from server.protocol.operator_state import ControlState, PhoneCompared, PhoneListed, ReachState
from server.protocol.questions import Question
from server.protocol.recording_state import RecordingState
from server.protocol.signal_state import Signals
from server.protocol.slow_down_state import SlowDownState

Cut = Literal["server-bridge", "bridge-car"]
# "none": messages came and had no number to give; null: none came.
Step = TypeAliasType("Step", float | Literal["none"] | None)


class ServerState(TypedDict):
    """The server, now."""

    time_ms: int
    boot: Annotated[str, doc("another one: another run of the server")]
    version: str
    pages: int
    frames_skipped: Annotated[int, doc("replaced by newer ones before a page took them")]
    loop_lag_ms: NotRequired[float]
    challenge: NotRequired[Annotated[str, doc("of an agent: what a device signs with its next order")]]
    excess_ms: NotRequired[Annotated[int, doc("of a web node: the state was likely made so long after `time_ms`")]]


class HeldState(TypedDict):
    """What stood when the server ended."""

    address: str | None
    alarms: int
    paused: bool


class PlannedStopState(TypedDict):
    """The car stands on purpose: its alarms are marked."""

    reason: StopReason
    by: str | None
    since_ms: int
    is_speed_known: Annotated[bool, doc("false: it does not end by itself until the speed is known")]


class TrackState(TypedDict):
    number: Annotated[int, doc("another one: another track")]
    last: Annotated[int, doc("number of its newest point")]


class SessionState(TypedDict):
    phase: Annotated[
        Phase,
        doc(
            "idle: no address; connecting: first attempts; failed: never connected yet, it keeps trying; "
            "monitoring: link open; lost: was open, it keeps trying"
        ),
    ]
    address: str | None
    name: str | None
    configured: Annotated[str | None, doc("the car that the server was started for: connect without an address")]
    ros_version: Annotated[int | None, doc("null until known")]
    profile: Annotated[str, doc("the kind of car it is taken for")]
    settings_version: Annotated[int, doc("another number: ask GET /api/settings again")]
    connected_for_s: float | None
    paused: bool
    paused_by: str | None
    paused_for_s: float
    planned_stop: NotRequired[Annotated[PlannedStopState | None, doc("null: there is none; not from older agents")]]
    held: Annotated[HeldState | None, doc("what was active when the server ended, while no car is monitored yet")]
    track_m: Annotated[float | None, doc("distance driven since connecting, from the car's positions")]
    track: TrackState
    received: int
    rejected: int


class ConnectionProblem(TypedDict):
    code: str
    title: Annotated[str, doc("one sentence")]
    hint: Annotated[str, doc("what to do")]
    mark: Annotated[str, doc("a short text under the broken node of the chain")]


class LinkState(TypedDict):
    cut: Annotated[Cut | None, doc("which part of the chain is broken; null: none")]
    since_ms: Annotated[int | None, doc("when the last data came from beyond the cut")]
    bridge_age_s: Annotated[float | None, doc("since the last data of the bridge; null: none")]
    car_age_s: Annotated[float | None, doc("since the last data of the car; null: none")]
    problem: Annotated[
        ConnectionProblem | None,
        doc("may be there while cut is null: a part behind the bridge failed, and messages still come"),
    ]
    attempts: int
    trying_for_s: float
    topics_subscribed: int
    topics_heard: int
    late_s: Annotated[
        float | None, doc("how old messages are when they come, estimated, at most 0.2 s too little; null: not known")
    ]
    most_late_s: Annotated[float | None, doc("how old messages are when they come, at most; null: not known")]
    reduced: Annotated[str | None, doc("what is not requested in full because the link is slow, as a sentence")]
    unreadable_frames: Annotated[int, doc("what came and was no rosbridge operation")]
    unreadable_why: str | None


class NearestState(TypedDict):
    time_gap_s: Annotated[float | None, doc("null while standing")]
    stopping_m: float | None


class Trends(TypedDict):
    """Steps of the last minute."""

    step_s: float
    since: Annotated[int, doc("the first step since this car was dialled")]
    first: Annotated[int, doc("number of the first step here")]
    now: Annotated[float, doc("the moment of the frame, as a step and its part")]
    lowest: dict[str, list[Step]]
    highest: dict[str, list[Step]]


class ReplayPosition(TypedDict):
    """The position of a replay."""

    at_s: Annotated[float, doc("the moment shown, or sought, since the recording's beginning")]
    at_ms: int
    start_ms: int
    end_ms: int
    length_s: float
    is_playing: bool
    rate: float
    reached_rate: Annotated[float | None, doc("a number where the server does not keep the pace")]
    is_seeking: Annotated[bool, doc("the rest is still the picture of before")]
    is_settled: Annotated[bool, doc("false: the checks were only warmed up over the 25 s before; below")]
    silent_s: Annotated[float | None, doc("since the car's newest message then; null: there was none yet")]
    seek: Annotated[int, doc("grows with each leap: another number, another minute and another track")]
    alarms_from: Annotated[Literal["recording", "judged"], doc("original alarms, or re-evaluated")]
    settings_from: Annotated[Literal["recording", "now"], doc("now: the recording does not hold the settings in force")]


class ReplayState(ReplayPosition):
    id: Annotated[str, doc("of the recording")]
    vehicle: Annotated[str, doc("the car that was recorded")]
    title: Annotated[str, doc('given by a person; "": none')]
    token: Annotated[str, doc("for requests of trends and track")]
    hangs_s: Annotated[float | None, doc("its process has sent nothing for so long")]


class LiveSummary(TypedDict):
    """What is live while a page replays."""

    phase: Phase
    name: str | None
    paused: bool
    cut: Cut | None
    problem: str | None
    recording: RecordingState
    control: ControlState
    reach: ReachState | None
    decelerate: SlowDownState
    alarms: Annotated[list[StandingAlarm], doc("at most 8")]
    alarms_in_all: int
    challenge: NotRequired[Annotated[str, doc("as `challenge` of a live state")]]


class RecordedState(TypedDict):
    """A state without what the server adds."""

    kind: Literal["state"]
    vehicle: str
    session: SessionState
    link: LinkState
    signals: Signals
    nearest: NearestState
    checks: list[Tile]
    alarms: Annotated[list[StandingAlarm], doc("the most urgent first")]
    suppressed: Annotated[list[SuppressedAlarm], doc("not announced, because others explain them; at most 20")]
    alarm_load: AlarmLoad
    log_trouble: Annotated[str | None, doc("why the log is not stored on the server's disk")]
    trends: Annotated[Trends, doc("the newest steps of the trends")]
    limits: Annotated[dict[str, float], doc("every threshold in force, by its full name")]
    recording: RecordingState
    decelerate: Annotated[SlowDownState, doc("the slow-down")]
    mode: Annotated[ModeState, doc("who drives")]
    control: ControlState
    reach: Annotated[ReachState | None, doc("whom an alarm would reach; null: of a recording")]
    phone: Annotated[PhoneCompared | None, doc("the phone that is compared with the car; null: none")]
    phones: Annotated[list[PhoneListed], doc("all that share a position, at most 12, the one compared first")]
    marks: Annotated[int, doc("how many marks this drive has, or a recording up to the moment shown")]
    questions: Annotated[
        list[Question], doc("open questions to the operator in control of this car, the most urgent first")
    ]


class ReplayEnvelope(TypedDict):
    """What the server adds to the state of a recording."""

    server: ServerState
    replay: ReplayState
    live: Annotated[LiveSummary | None, doc("of the live car; null: not known")]


class LiveState(RecordedState):
    """The state of a vehicle."""

    server: ServerState
    departure: NotRequired[Annotated[DepartureState, doc("the departure check; left out of a recording's state")]]


class State(LiveState):
    """What a page gets: the state of a vehicle, or of a recording."""

    replay: NotRequired[Annotated[ReplayState, doc("of a recording only")]]
    live: NotRequired[Annotated[LiveSummary | None, doc("of a recording only: what is live meanwhile")]]
