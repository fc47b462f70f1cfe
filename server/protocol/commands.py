"""What a page or a program may order: one model a command, refused with a sentence where it does not fit.

Each model declares who may send it, whether it is served over HTTP as well, and whether a page in a replay may.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from server.protocol import signed_order
from server.protocol.command_base import BaseCommand, Name, Needs, Number, PageName, Prompt, Signature
from server.protocol.doc import doc
from server.protocol.drive_commands import (
    DepartureCommand,
    DescribeIntervention,
    MarkCommand,
    PlannedStopCommand,
    SlowingCommand,
)
from server.protocol.handover_commands import HandoverCommand, ItemCommand, TakeAlarm

MAX_COMMAND_BYTES = 16 * 1024


class Connect(Prompt):
    """Dials a car; it is tried until disconnected."""

    http: ClassVar[str] = "Dial a car's rosbridge; it is tried until disconnected"
    kind: Literal["connect"]
    address: Annotated[
        str,
        Field(
            max_length=300,
            examples=["ws://192.168.4.1:9090"],
            description="host, host:port, ws://, wss:// or foxglove://; empty: the car that was configured",
        ),
    ] = ""


class Retry(BaseCommand):
    """Dials at once."""

    kind: Literal["retry"]


class Disconnect(Prompt):
    """Ends monitoring: the session is idle."""

    http: ClassVar[str] = "Stop monitoring"
    kind: Literal["disconnect"]


class Pause(Prompt):
    """Pauses monitoring: values go on, no alarm comes."""

    http: ClassVar[str] = "Pause monitoring: values continue, no alarm is raised"
    kind: Literal["pause"]


class Resume(Prompt):
    """Ends the pause."""

    acts_within_s: ClassVar[float] = 3.0  # nothing moves by it

    http: ClassVar[str] = "Monitor again"
    kind: Literal["resume"]


class Record(BaseCommand):
    """Begins or ends a recording by hand; refused with the reason, the disk's too."""

    http: ClassVar[str] = "Begin to record, or end it, by hand"
    kind: Literal["record"]
    on: Annotated[bool, doc("true begins a recording, false ends the one that is made")]


class Acknowledge(BaseCommand):
    """The operator has seen this occurrence."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "The operator has seen this occurrence"
    path: ClassVar[str] = "/api/alarms/{alarm}/acknowledge"
    from_fleet: ClassVar[bool] = True
    kind: Literal["acknowledge"]
    alarm: Name
    occurrence: Annotated[Number, doc("which occurrence was seen; an older one is refused")]


class Silence(Prompt):
    """No sound of this occurrence for 30 s; it still waits for its acknowledgement."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "No sound of this occurrence for 30 s; it is not acknowledged by that"
    path: ClassVar[str] = "/api/alarms/{alarm}/silence"
    kind: Literal["silence"]
    alarm: Name
    occurrence: Annotated[Number, doc("which occurrence is silenced; an older one is refused")]


class Shelve(Prompt):
    """Hides an alarm for a time."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["shelve"]
    alarm: Name
    occurrence: Number
    minutes: Annotated[float, Field(gt=0, le=15)] = 5.0


class Unshelve(BaseCommand):
    """Ends the shelving of an alarm."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["unshelve"]
    alarm: Name


class Set(BaseCommand):
    """Changes settings."""

    kind: Literal["set"]
    values: dict[Name, float | None] = Field(
        default_factory=dict,
        max_length=500,
        examples=[{"speed_limit.max_mps": 9.0}],
        description="in SI; null restores the default",
    )
    topics: dict[Name, str | None] = Field(
        default_factory=dict, max_length=50, description="signal → topic; null: as found"
    )
    units: dict[Name, Name | None] = Field(
        default_factory=dict, max_length=50, description="signal → name of its unit; null: as found"
    )
    profile: Annotated[Name | None, doc("a profile's name, or auto")] = None
    version: Annotated[Number | None, doc("refused where the settings are no longer at this version")] = None


class Import(BaseCommand):
    """All settings at once, from a TOML file."""

    kind: Literal["import"]
    toml: Annotated[str, Field(max_length=64 * 1024)]


class Fix(BaseModel):
    """A position as the W3C Geolocation API gives it, WGS84. No clock of the page is compared with the server's:
    `age_s` is reckoned on the phone, and `heard_ms` is the server's own time in the newest state that the page had,
    `held_s` how long it had had it."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)
    lat_deg: Annotated[float, Field(ge=-90, le=90)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    accuracy_m: Annotated[float, Field(ge=0, le=1e7)]
    alt_m: Annotated[float, Field(ge=-2e4, le=1e6)] | None = None
    speed_mps: Annotated[float, Field(ge=0, le=1e4)] | None = None
    heading_deg: Annotated[float, Field(ge=0, le=360)] | None = None
    at_ms: Annotated[float, Field(ge=0, le=2**53)]  # by the phone's own clock, which may be wrong by hours: shown only
    age_s: Annotated[float, Field(ge=0, le=86_400)]
    heard_ms: Annotated[float, Field(ge=0, le=2**53)]
    held_s: Annotated[float, Field(ge=0, le=86_400)]


class Position(BaseCommand):
    """Where this phone is, or why that is not known: either `fix` or `why`."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # the live monitor must know, whatever the page shows
    signature: ClassVar[Signature] = "none"
    kind: Literal["position"]
    phone: PageName
    handheld: bool
    fix: Fix | None = None
    why: Literal["denied", "unavailable", "timeout", "insecure", "hidden", "off"] | None = None

    @model_validator(mode="after")
    def _is_either(self) -> Self:
        if (self.fix is None) == (self.why is None):
            raise PydanticCustomError("position", "it needs either a position or the reason for having none")
        return self


class Ride(BaseCommand):
    """Chooses the phone that is in the car and is compared with it."""

    kind: Literal["ride"]
    phone: Annotated[PageName | None, doc("null: none is chosen, one is found")]


class TakeControl(Prompt):
    """Takes, gives or requests control; server/control/lease.py has the rules."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page from which control is requested answers
    kind: Literal["control"]
    do: Literal["take", "take_over", "release", "request", "withdraw", "hand_over", "keep"]
    to: Annotated[PageName | None, doc("of hand_over: the page that gets it; of keep: whose request is refused")] = None

    @model_validator(mode="after")
    def _says_whom(self) -> Self:
        if (self.to is not None) != (self.do in ("hand_over", "keep")):
            raise PydanticCustomError(
                "control", "`to` is required to hand over or keep control, and not allowed otherwise"
            )
        return self


class PresentWord(BaseCommand):
    """The state of a page, once a second and at each change: whether it is seen, and whether an alarm would sound from
    it. Nothing answers it but its refusal."""

    needs: ClassVar[Needs] = "operator"
    signature: ClassVar[Signature] = "none"
    kind: Literal["present"]
    visible: bool
    draws: Annotated[bool, doc("false: drawing fails, and the page covers its values")] = True
    sound: Literal["ready", "refused", "asks", "missing", "interrupted"]
    awake: Literal["ready", "refused", "asks", "missing"]
    vibrates: bool = False
    battery: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    charging: bool | None = None
    lag_s: Annotated[float, Field(ge=0, allow_inf_nan=False, description="age of its newest state")] = 0.0
    key: Annotated[Name | None, doc("id of the key by which the page signs its orders")] = None
    leaves: Annotated[bool, doc("it is closed, or another page takes its place")] = False
    announces: list[Name] = Field(
        default_factory=list, max_length=100, description="the other cars whose next alarm would sound from it"
    )


class AskOutcome(BaseCommand):
    """What became of a command whose answer was lost. One that did not arrive yet is not carried out any more."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True
    from_fleet: ClassVar[bool] = True
    signature: ClassVar[Signature] = "none"
    kind: Literal["outcome"]
    of: Annotated[str, Field(max_length=80, description="the `id` of the command")]
    ago_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False, description="since it was requested, at most")]


LoggedCommand = (
    Connect
    | Retry
    | Disconnect
    | Pause
    | Resume
    | Record
    | Acknowledge
    | Silence
    | Shelve
    | Unshelve
    | Set
    | Import
    | Position
    | Ride
    | TakeControl
    | ItemCommand
    | HandoverCommand
    | TakeAlarm
    | MarkCommand
    | DepartureCommand
    | SlowingCommand
    | DescribeIntervention
    | PlannedStopCommand
)
Command = LoggedCommand | PresentWord | AskOutcome


def kind_of(command: type[Command]) -> str:
    """The `kind` by which a command is sent."""
    return str(get_args(command.model_fields["kind"].annotation)[0])


BY_KIND: Mapping[str, type[Command]] = {kind_of(one): one for one in get_args(Command)}
KINDS = frozenset(BY_KIND)
SLOW_DOWN = frozenset(kind for kind, one in BY_KIND.items() if one in get_args(SlowingCommand))
COMES_WITHIN_S = {kind: one.acts_within_s for kind, one in BY_KIND.items() if issubclass(one, Prompt)}
NO_SUCH = "Unknown command."
_COMMANDS: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="kind")])


class NotUnderstood(ValueError):
    """A command or an order does not fit its model; `str()` is one sentence."""

    @classmethod
    def of(cls, error: ValidationError, *, whole: str, no_such: str) -> NotUnderstood:
        """From the first fault that pydantic found; `whole`: what it is called where the fault is in no field."""
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
            return cls(no_such)
        where = ".".join(str(part) for part in first["loc"][1:]) or whole
        return cls(f"{where}: {first['msg']}.")


def comes_within_s(message: Mapping[str, Any]) -> float | None:
    """In what time a command must reach the session of its car [s]; None: it may take as long as its answer.

    What a device signed with the time of its newest state needs no such time: the session finds its age from that, and
    better than by the clock of an agent, which is known only to a whole round trip.
    """
    kind = message.get("kind")
    within_s = COMES_WITHIN_S.get(kind) if isinstance(kind, str) else None
    return None if within_s is None or _has_age(message.get("signed")) else within_s


def _has_age(signed: object) -> bool:
    """Whether a signed text, which only the agent can prove, has the time of a state."""
    if signed is None:
        return False
    try:
        text = signed_order.read_text(signed_order.read_envelope(signed).text)
    except signed_order.NotReadable:
        return False
    return text.command.get("heard_ms") is not None


def too_late(message: Mapping[str, Any], wall_ms: float) -> str | None:
    """Why a command is refused that took too long to come here, as a sentence; None: it did not, or cannot be read."""
    try:
        command = read(message)
    except NotUnderstood:
        return None  # the session reports it
    return command.too_late(wall_ms) if isinstance(command, Prompt) else None


def read(command: Any) -> Command:
    """The command in a decoded JSON value. Raises NotUnderstood."""
    try:
        return _COMMANDS.validate_python(command)
    except ValidationError as error:
        raise NotUnderstood.of(error, whole="the command", no_such=NO_SUCH) from None
