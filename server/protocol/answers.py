"""What the server answers over HTTP, as JSON that the page reads."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from pydantic import Field
from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from server.protocol.alarm_state import CheckAnswer
from server.protocol.departure import DepartureAnswer
from server.protocol.doc import doc
from server.protocol.drive_trends import DriveTrendsAnswer
from server.protocol.driving_state import DrivingAnswer, InterventionAnswer
from server.protocol.logbook import Course, LogbookAnswer
from server.protocol.marks import DriveMark, MarkList
from server.protocol.people import PeopleList
from server.protocol.questions import TopicOffer

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


class UnitChoice(TypedDict):
    name: str
    label: str


class SettingsAnswer(TypedDict):
    """`GET /api/settings`."""

    version: int
    profile: ProfileAnswer
    profiles: list[ProfileChoice]
    values: Annotated[dict[str, float], doc("in force, by full name")]
    defaults: dict[str, float]
    changed: Annotated[list[str], doc("what differs from its default")]
    topics: Annotated[dict[str, str], doc("signal → topic, of those that were chosen")]
    units: Annotated[dict[str, str], doc("signal → name of its unit, of those that were chosen")]
    unit_choices: Annotated[dict[str, list[UnitChoice]], doc("signal → the units it may be published in")]
    schema: Annotated[dict[str, SettingField], doc("in the order of Settings")]


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


class VerificationBreak(TypedDict):
    """Where a hash chain breaks: the record whose hash does not hold, and what it covers."""

    record: int
    from_byte: int
    to_byte: int
    from_ns: Annotated[int, doc("ns since 1970; 0: not known")]
    to_ns: int


class VerificationAnswer(TypedDict):
    """Whether a recording is as it was recorded."""

    state: Annotated[
        Literal["intact", "broken", "unfinished", "no chain", "unreadable"],
        doc("unfinished: it ends before its seal; no chain: recorded by an older version"),
    ]
    is_broken: Annotated[bool, doc("broken or unfinished, or a recording beside it names another hash")]
    short: Annotated[str, doc("a short text, as *Intact · 3f9a12bc* or *Broken at record 57*")]
    sentence: str
    records: int
    head: Annotated[str | None, doc("SHA-256 of the last record [hex]; null: there is none, or it is broken")]
    broken: VerificationBreak | None
    is_recovered: Annotated[bool, doc("the recorder was interrupted, and the file completed later")]
    previous: Annotated[str | None, doc("the recording that it names as the one before it")]
    previous_missing: bool
    problems: Annotated[list[str], doc("what recordings beside it object, a sentence each")]
    at_ms: Annotated[int, doc("when it was verified")]


class StoredCopy(TypedDict):
    """The copy of a recording in the store."""

    state: Annotated[Literal["none", "waiting", "uploading", "stored", "failed"], doc("of the whole file")]
    share: Annotated[float | None, doc("of the whole file that is in the store, 0 to 1; null: none is being uploaded")]
    checked_ms: Annotated[int | None, doc("when the copy was read back and was the same")]
    sentence: Annotated[str, doc("why it is not there, or why it failed; empty: nothing to say")]
    clips: Annotated[int, doc("clips around alarms that are in the store")]
    is_asked: Annotated[bool, doc("a person's request stands, which can be taken back")]
    is_deletion_asked: Annotated[bool, doc("it is deleted here once the copy was read back, by request or setting")]


class StoreFacts(TypedDict):
    """The store of a server."""

    address: str
    problem: Annotated[str | None, doc("why nothing is uploaded now, as a sentence")]


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
    weather: Annotated[str, doc('for the report of the drive; "": nobody entered it')]
    tags: list[str]
    marks: Annotated[int, doc("how many; a search covers their texts")]
    matched: NotRequired[Annotated[DriveMark, doc("of a search by text: the first mark whose text or category has it")]]
    late: NotRequired[
        Annotated[str, doc("another value: other marks or descriptions came after it was complete; left out: none did")]
    ]
    late_marks: NotRequired[
        Annotated[list[DriveMark], doc("of one recording: those that came after it was complete, at most 200")]
    ]
    state: Annotated[
        Literal["waiting", "read", "unreadable"],
        Field(title="Reading", description="waiting: listed by its name, and read soon"),
    ]
    problem: Annotated[str | None, doc("why it cannot be read, as a sentence")]
    damage: Annotated[list[str], doc("what of it cannot be read, a sentence each")]
    unread: Annotated[list[str], doc("topics whose messages are of no use here, a sentence each; at most 10")]
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
    format: Annotated[str, doc("mcap · bag · db3 · zstd · folder")]
    several_files: Annotated[
        str | None, doc("why no single file is a copy of it, as text behind “it is”; null: its file is all of it")
    ]
    sha256: str | None
    head: Annotated[str | None, doc("SHA-256 of the last record of its hash chain [hex], not verified; null: none")]
    verified: Annotated[VerificationAnswer | None, doc("null: this file was not verified since the server started")]
    thumbnail: str
    sketch: Annotated[SketchAnswer | None, doc("null: no position")]
    trashed_ms: int | None
    stored: NotRequired[Annotated[StoredCopy, doc("where the server has a store")]]
    raised: NotRequired[Annotated[list[RaisedAlarm], doc("of a recording that is requested alone; at most 200")]]
    speed_mps: NotRequired[
        Annotated[
            list[float | None],
            doc("of a recording that is requested alone: the highest speed of at most 361 equal parts; empty: none"),
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
    store: NotRequired[Annotated[StoreFacts, doc("where the server has one")]]


class StoredClip(TypedDict):
    name: str
    at_ms: Annotated[int, doc("the alarm it is about")]
    size_bytes: int


class StoredRecording(TypedDict):
    """A row of `GET /api/stored`, as the agent wrote it into the store."""

    id: str
    vehicle: str
    folder: Annotated[str, doc("of the vehicle, in addresses")]
    title: str
    started_ms: int
    length_s: float | None
    distance_m: float | None
    top_speed_mps: float | None
    alarms: dict[Priority, int] | None
    sketch: SketchAnswer | None
    file: Annotated[str | None, doc("its name, if the whole file is stored and was verified")]
    size_bytes: Annotated[int | None, doc("of the whole file in the store")]
    sha256: str | None
    checked_ms: int | None
    clips: list[StoredClip]


class StoredList(TypedDict):
    """`GET /api/stored`."""

    store: str
    recordings: list[StoredRecording]
    next: Annotated[str | None, doc("the `cursor` of the page after this one")]
    count: int


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


# All of them; their schemas are made from it.
Answers = (
    SettingsAnswer
    | SignalsAnswer
    | CheckAnswer
    | TrackPoints
    | RecordingList
    | LogbookAnswer
    | Course
    | VerificationAnswer
    | StoredList
    | ExportJob
    | DeviceList
    | DriveTrendsAnswer
    | PeopleList
    | InterventionAnswer
    | DrivingAnswer
    | MarkList
    | DepartureAnswer
)
