"""What a page or a program may order: one model a command, refused with a sentence where it does not fit.

Each model says who may, whether it is served over HTTP as well, and whether a page that replays may send it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from server.protocol.command_base import BaseCommand, Name, Needs, Number, PageName
from server.protocol.doc import doc

MAX_COMMAND_BYTES = 16 * 1024


class Connect(BaseCommand):
    """Dials a car; it is tried until disconnected."""

    http: ClassVar[str] = "Dial a car's rosbridge; it is tried until disconnected"
    kind: Literal["connect"]
    address: Annotated[
        str,
        Field(
            max_length=300,
            examples=["ws://192.168.4.1:9090"],
            description="host, host:port, ws:// or wss://; empty: the car that was configured",
        ),
    ] = ""


class Retry(BaseCommand):
    """Dials at once."""

    kind: Literal["retry"]


class Disconnect(BaseCommand):
    """Ends monitoring: the session is idle."""

    http: ClassVar[str] = "End monitoring"
    kind: Literal["disconnect"]


class Pause(BaseCommand):
    """Pauses monitoring: values go on, no alarm comes."""

    http: ClassVar[str] = "Pause monitoring: values continue, no alarm is raised"
    kind: Literal["pause"]


class Resume(BaseCommand):
    """Ends the pause."""

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
    kind: Literal["acknowledge"]
    alarm: Name
    occurrence: Annotated[Number, doc("which occurrence was seen; an older one is refused")]


class Silence(BaseCommand):
    """No sound of this occurrence for 30 s; it still waits for its acknowledgement."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "No sound of this occurrence for 30 s; it is not acknowledged by that"
    path: ClassVar[str] = "/api/alarms/{alarm}/silence"
    kind: Literal["silence"]
    alarm: Name
    occurrence: Annotated[Number, doc("which occurrence is silenced; an older one is refused")]


class Shelve(BaseCommand):
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
        description="in SI; null goes back to the default",
    )
    topics: dict[Name, str | None] = Field(
        default_factory=dict, max_length=50, description="signal → topic; null: as found"
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


class TakeControl(BaseCommand):
    """Takes, gives or requests control; server/control/lease.py says who may do what."""

    needs: ClassVar[Needs] = "operator"
    passes_replay: ClassVar[bool] = True  # a page that is asked for control answers
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
    """How a page stands, once a second and at each change: whether it is seen, and whether an alarm would be heard from
    it. Nothing answers it but its refusal."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["present"]
    visible: bool
    draws: Annotated[bool, doc("false: drawing fails, and the page covers its values")] = True
    sound: Literal["ready", "refused", "asks", "missing", "interrupted"]
    awake: Literal["ready", "refused", "asks", "missing"]
    vibrates: bool = False
    battery: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    charging: bool | None = None
    lag_s: Annotated[float, Field(ge=0, allow_inf_nan=False, description="age of its newest state")] = 0.0
    leaves: Annotated[bool, doc("it is closed, or another page takes its place")] = False
    announces: list[Name] = Field(
        default_factory=list, max_length=100, description="the other cars whose next alarm would be heard from it"
    )


class OfCar(BaseCommand):
    """Acts on the car itself: refused where it was meant for another one."""

    vehicle: Annotated[Name | None, doc("the car that the page named to its operator; refused by any other")] = None


class Arm(OfCar):
    """Slow-down may be ordered from now on."""

    http: ClassVar[str] = "Slow-down may be ordered from now on"
    path: ClassVar[str] = "/api/slow-down/arm"
    has_body: ClassVar[bool] = False
    kind: Literal["arm"]


class Disarm(OfCar):
    """Slow-down may not be ordered any more."""

    http: ClassVar[str] = "Nothing can be ordered any more"
    path: ClassVar[str] = "/api/slow-down/disarm"
    has_body: ClassVar[bool] = False
    kind: Literal["disarm"]


class Decelerate(OfCar):
    """Slows the car, once armed; refused where it took longer than 300 ms on its way."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Slow the car, and hold it until it is released; no emergency stop"
    path: ClassVar[str] = "/api/slow-down/order"
    has_body: ClassVar[bool] = False
    kind: Literal["slow_down"]
    pressed_ago_s: Annotated[
        float, Field(ge=0, le=86_400, allow_inf_nan=False, description="since the finger let go, when it was sent")
    ] = 0.0
    heard_ms: Annotated[float, Field(ge=0, le=2**53, allow_inf_nan=False)] | None = None
    held_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0

    def late_s(self, wall_ms: float) -> float:
        """How long ago it was pressed, at least: half of the way there and back belongs to this direction."""
        way_s = 0.0 if self.heard_ms is None else max(0.0, (wall_ms - self.heard_ms) / 1000 - self.held_s)
        return self.pressed_ago_s + way_s / 2


class Release(OfCar):
    """Ends the order, or the guard's hold, of this number: whoever drives may drive on."""

    http: ClassVar[str] = "The driver or controller may continue"
    path: ClassVar[str] = "/api/slow-down/release"
    kind: Literal["release"]
    number: Annotated[Number, doc("of the very order that ends, as the state names it")]


class Veto(OfCar):
    """Stops a count-down: the car is not slowed by itself this time."""

    needs: ClassVar[Needs] = "operator"
    http: ClassVar[str] = "Not slowed by itself this time"
    path: ClassVar[str] = "/api/slow-down/veto"
    passes_replay: ClassVar[bool] = True
    kind: Literal["veto"]
    trigger: Annotated[Name, doc("as the count-down names it")]


SlowingCommand = Arm | Disarm | Decelerate | Release | Veto
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
    | SlowingCommand
)
Command = LoggedCommand | PresentWord


def kind_of(command: type[Command]) -> str:
    """The `kind` by which a command is sent."""
    kind: str = get_args(command.model_fields["kind"].annotation)[0]
    return kind


BY_KIND: Mapping[str, type[Command]] = {kind_of(one): one for one in get_args(Command)}
KINDS = frozenset(BY_KIND)
SLOW_DOWN = frozenset(kind for kind, one in BY_KIND.items() if one in get_args(SlowingCommand))
NO_SUCH = "Unknown command."
_COMMANDS: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="kind")])


class NotUnderstood(ValueError):
    """The command does not fit its model; `str()` is one sentence."""


def read(command: Any) -> Command:
    """The command in a decoded JSON value. Raises NotUnderstood."""
    try:
        return _COMMANDS.validate_python(command)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
            raise NotUnderstood(NO_SUCH) from None
        where = ".".join(str(part) for part in first["loc"][1:]) or "the command"
        raise NotUnderstood(f"{where}: {first['msg']}.") from None
