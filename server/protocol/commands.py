"""What a page may ask for: one model a command, refused with a sentence where it does not fit."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic_core import PydanticCustomError

MAX_COMMAND_BYTES = 16 * 1024
PAGE = r"^[0-9a-z-]{4,40}$"
Name = Annotated[str, Field(min_length=1, max_length=120)]
Number = Annotated[int, Field(ge=0, le=2**53)]
PageName = Annotated[str, Field(pattern=PAGE)]  # by which a page, and the phone it is on, knows itself
# Any operator, or only the one who is in control. Slowing the car is to need no more than an operator, letting it go
# control.
Needs = Literal["operator", "control"]


class _Command(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)
    needs: ClassVar[Needs] = "control"  # what is not said to need less
    id: Annotated[str, Field(max_length=80)] | None = None


class Connect(_Command):
    """Without an address: to the car that was configured when the server was started."""

    kind: Literal["connect"]
    address: Annotated[str, Field(max_length=300)] = ""


class Retry(_Command):
    kind: Literal["retry"]


class Disconnect(_Command):
    kind: Literal["disconnect"]


class Pause(_Command):
    kind: Literal["pause"]


class Resume(_Command):
    kind: Literal["resume"]


class Record(_Command):
    """Begin to record, or end it, by hand."""

    kind: Literal["record"]
    on: bool


class Acknowledge(_Command):
    needs: ClassVar[Needs] = "operator"
    kind: Literal["acknowledge"]
    alarm: Name
    occurrence: Number


class Shelve(_Command):
    needs: ClassVar[Needs] = "operator"
    kind: Literal["shelve"]
    alarm: Name
    occurrence: Number
    minutes: Annotated[float, Field(gt=0, le=15)] = 5.0


class Unshelve(_Command):
    needs: ClassVar[Needs] = "operator"
    kind: Literal["unshelve"]
    alarm: Name


class Set(_Command):
    """Settings to change; null takes one back to its default. `version`: refused when they changed since."""

    kind: Literal["set"]
    values: dict[Name, float | None] = Field(default_factory=dict, max_length=500)
    topics: dict[Name, str | None] = Field(default_factory=dict, max_length=50)
    profile: Name | None = None
    version: Number | None = None


class Import(_Command):
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


class Position(_Command):
    """Where this phone is, or why it cannot tell."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["position"]
    phone: PageName
    handheld: bool
    fix: Fix | None = None
    why: Literal["denied", "unavailable", "timeout", "insecure", "hidden", "off"] | None = None

    @model_validator(mode="after")
    def _is_either(self) -> Self:
        if (self.fix is None) == (self.why is None):
            raise PydanticCustomError("position", "it says either where the phone is or why it cannot tell")
        return self


class Ride(_Command):
    """Which phone rides in the car and is compared with it; null: nobody says, one is found."""

    kind: Literal["ride"]
    phone: PageName | None


class TakeControl(_Command):
    """Control is taken, given, asked for; server/control/lease.py says who may do what."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["control"]
    do: Literal["take", "take_over", "release", "request", "withdraw", "hand_over", "keep"]
    to: PageName | None = None  # of hand_over and keep: the page

    @model_validator(mode="after")
    def _says_whom(self) -> Self:
        if (self.to is not None) != (self.do in ("hand_over", "keep")):
            raise PydanticCustomError("control", "it says to whom where control is handed over or kept, and only there")
        return self


class PresentWord(_Command):
    """How a page stands, once a second: whether it is seen, and whether an alarm would be heard from it. It is no
    order: nothing answers it but its refusal."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["present"]
    visible: bool
    draws: bool = True  # false: what shows its values and alarms has failed
    sound: Literal["ready", "refused", "asks", "missing", "interrupted"]
    awake: Literal["ready", "refused", "asks", "missing"]
    vibrates: bool = False
    battery: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] | None = None
    charging: bool | None = None
    lag_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0  # age of its newest state
    leaves: bool = False  # it is closed, or another page takes its place


class Arm(_Command):
    """Slow-down may be ordered from now on."""

    kind: Literal["arm"]


class Disarm(_Command):
    kind: Literal["disarm"]


class Decelerate(_Command):
    """Slow the car. `pressed_ago_s`: since the finger let go, when it was sent; `heard_ms` and `held_s` as in a Fix:
    what took too long on its way is not obeyed. A program gives none of them."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["slow_down"]
    pressed_ago_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0
    heard_ms: Annotated[float, Field(ge=0, le=2**53, allow_inf_nan=False)] | None = None
    held_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0

    def late_s(self, wall_ms: float) -> float:
        """How long ago it was pressed, at least: half of the way there and back belongs to this direction."""
        way_s = 0.0 if self.heard_ms is None else max(0.0, (wall_ms - self.heard_ms) / 1000 - self.held_s)
        return self.pressed_ago_s + way_s / 2


class Release(_Command):
    """Whoever drives may drive on: ends the order, or the guard's hold, of this number."""

    kind: Literal["release"]
    number: Number


class Veto(_Command):
    """Not slowed by itself this time."""

    needs: ClassVar[Needs] = "operator"
    kind: Literal["veto"]
    trigger: Name


SlowingCommand = Arm | Disarm | Decelerate | Release | Veto
Command = (
    Connect
    | Retry
    | Disconnect
    | Pause
    | Resume
    | Record
    | Acknowledge
    | Shelve
    | Unshelve
    | Set
    | Import
    | Position
    | Ride
    | TakeControl
    | PresentWord
    | SlowingCommand
)
KINDS = frozenset(get_args(one.model_fields["kind"].annotation)[0] for one in get_args(Command))
NO_SUCH = "There is no such command."
_COMMANDS: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="kind")])


def is_of_settings(command: Command) -> bool:
    """Whether it makes another version of the settings."""
    return isinstance(command, (Set, Import))


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
