"""What the server answers over HTTP, as JSON that the page reads."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from server.protocol.check_state import CheckAnswer
from server.protocol.doc import doc
from server.protocol.drive_trends import DriveTrendsAnswer

ExportState = Literal["waiting", "working", "done", "failed", "cancelled"]


class ProfileAnswer(TypedDict):
    """The kind of car."""

    name: str
    title: str
    chosen: Annotated[str, doc("by the operator; auto: as recognised")]
    recognised: str


class ProfileChoice(TypedDict):
    name: str
    title: str


class SettingField(TypedDict):
    """One threshold as it is declared, in SI."""

    title: str
    heading: Annotated[str, doc("its heading in Settings")]
    unit: str
    default: float
    minimum: float
    maximum: float
    step: NotRequired[float]
    description: NotRequired[str | None]
    type: NotRequired[str]


class SettingsAnswer(TypedDict):
    """`GET /api/settings`."""

    version: int
    profile: ProfileAnswer
    profiles: list[ProfileChoice]
    values: Annotated[dict[str, float], doc("in force, by full name")]
    defaults: dict[str, float]
    changed: Annotated[list[str], doc("what differs from its default")]
    topics: Annotated[dict[str, str], doc("signal → topic, of those that were chosen")]
    schema: Annotated[dict[str, SettingField], doc("in the order of Settings")]


class TopicOffer(TypedDict):
    topic: str
    type: str


class SignalsAnswer(TypedDict):
    """`GET /api/signals`."""

    candidates: Annotated[
        dict[str, list[TopicOffer]] | None,
        doc("topics that can carry each signal, those of the expected type first; null: the bridge does not say"),
    ]
    topics: Annotated[list[TopicOffer], doc("beyond the signals")]
    rejected: Annotated[dict[str, dict[str, int]], doc("label of a signal → reason → how many")]
    unreadable_frames: dict[str, int]
    unasked: int


class TrackPoints(TypedDict):
    """`GET /api/track/points`."""

    number: Annotated[int, doc("of the track")]
    points: Annotated[
        list[tuple[int, float, float, float, int]],
        doc(
            "number, latitude, longitude, the server's clock [s], and how it joins the point before: 0 driven, "
            "1 after more than 5 s without a position, 2 the position leapt"
        ),
    ]


class Total(TypedDict):
    count: int
    bytes: int


class ExportFormat(TypedDict):
    name: str
    label: str
    use: str
    ros_version: Annotated[int | None, doc("only recordings of it can be exported; null: all")]


class SketchAnswer(TypedDict):
    """The track in a square of 64, y down."""

    lines: Annotated[list[list[float]], doc("x, y, x, y …")]
    start: list[float]
    marks: Annotated[list[tuple[float, float, str]], doc("x, y and priority of each alarm")]


class RaisedAlarm(TypedDict):
    at_ms: int
    priority: Priority
    alarm: str
    title: str
    text: str


class Recording(TypedDict):
    """A row of `GET /api/recordings`."""

    id: str
    vehicle: str
    session: str | None
    part: int | None
    started_ms: int
    length_s: Annotated[float | None, doc("null: not read yet, or unreadable")]
    size_bytes: int
    distance_m: Annotated[float | None, doc("null: no position")]
    top_speed_mps: Annotated[float | None, doc("null: no speed")]
    alarms: Annotated[dict[Priority, int] | None, doc("raised in it; null: no alarms were recorded with it")]
    title: str
    note: str
    tags: list[str]
    state: Annotated[Literal["waiting", "read", "unreadable"], doc("waiting: listed by its name, and read soon")]
    problem: Annotated[str | None, doc("why it cannot be read, as a sentence")]
    damage: Annotated[list[str], doc("what of it cannot be read, a sentence each")]
    left_out: Annotated[list[str], doc("topics that were not recorded; at most 10")]
    left_out_count: int
    not_received: Annotated[
        list[str], doc("topics that had a publisher at the end, and of which no message came; at most 10")
    ]
    not_received_count: int
    ros_version: Annotated[int | None, doc("null: not read yet")]
    ended: Annotated[str | None, doc("closed · recovered; null: not known")]
    ended_why: str | None
    is_clip: bool
    clip_of: str | None
    file: Annotated[str, doc("its name in the folder")]
    format: Annotated[str, doc("mcap · bag · db3")]
    sha256: str | None
    thumbnail: str
    sketch: Annotated[SketchAnswer | None, doc("null: no position")]
    trashed_ms: int | None
    raised: NotRequired[Annotated[list[RaisedAlarm], doc("of a recording that is asked for alone; at most 200")]]
    speed_mps: NotRequired[
        Annotated[
            list[float | None],
            doc("of a recording that is asked for alone: the highest speed of at most 361 equal parts; empty: none"),
        ]
    ]


class RecordingNames(TypedDict):
    vehicles: list[str]
    tags: list[str]


class RecordingList(RecordingNames):
    """`GET /api/recordings`."""

    recordings: list[Recording]
    next: Annotated[str | None, doc("the `cursor` of the page after this one")]
    found: Total
    all: Total
    trash: Total
    free_bytes: int | None
    waiting: Annotated[int, doc("files that are yet to be read")]
    formats: list[ExportFormat]


class ExportJob(TypedDict):
    """An export or a clip, as `GET /api/exports/{job}` answers."""

    job: str
    of: Annotated[str, doc("the recording")]
    format: str
    state: ExportState
    progress: float
    sentence: Annotated[str, doc("of one that failed: why; of a clip that waits: for how long")]
    notes: Annotated[list[str], doc("what is not in it, and remarks, a sentence each")]
    is_whole: Annotated[
        bool | None, doc("false: something of the recording is not in it, and `notes` name it; null: not made yet")
    ]
    size_bytes: int | None
    recording: Annotated[str | None, doc("of a clip that is done: the id of the new recording")]


class DeviceRow(TypedDict):
    """A paired device."""

    id: str
    name: str
    role: Literal["viewer", "operator"]
    paired_ms: int
    seen_ms: int
    sockets: Annotated[int, doc("pages it has open now")]


class DeviceList(TypedDict):
    """`GET /api/devices`."""

    you: str
    open: Annotated[bool, doc("this server pairs no devices")]
    devices: list[DeviceRow]


# All of them; for whoever makes their schemas.
Answers = (
    SettingsAnswer
    | SignalsAnswer
    | CheckAnswer
    | TrackPoints
    | RecordingList
    | ExportJob
    | DeviceList
    | DriveTrendsAnswer
)
