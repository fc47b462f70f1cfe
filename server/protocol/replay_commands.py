"""What a page may order its replay: one model an order, refused with a sentence where it does not fit."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

Moment = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]

ShortText = Annotated[str, Field(max_length=300)]


class _Order(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)
    kind: Literal["replay"]
    id: Annotated[str, Field(max_length=80)] | None = None


class OpenReplay(_Order):
    """Opens a recording by its id, at a moment [s since its beginning]. `topics` (signal → topic) and `units` (signal →
    name) are chosen for this replay, before those that were recorded."""

    do: Literal["open"]
    recording: Annotated[str, Field(min_length=1, max_length=120)]
    at_s: Moment = 0.0
    topics: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)
    units: dict[ShortText, ShortText] = Field(default_factory=dict, max_length=50)


class OpenBeside(_Order):
    """Opens a second recording beside the one that is replayed, to compare both."""

    do: Literal["beside"]
    recording: Annotated[str, Field(min_length=1, max_length=120)]
    at_s: Moment = 0.0


class CloseBeside(_Order):
    """Closes the second recording; the first one stays."""

    do: Literal["alone"]


class _Led(_Order):
    beside: bool = False  # for the second recording, not the first


class LeaveReplay(_Order):
    """Back to live."""

    do: Literal["leave"]


class SeekReplay(_Led):
    """To a moment; beyond an end is that end."""

    do: Literal["seek"]
    at_s: Moment


class PlayReplay(_Led):
    """Resumes; from the beginning where it is at the end."""

    do: Literal["play"]


class PauseReplay(_Led):
    """Stands still."""

    do: Literal["pause"]


class SetReplayRate(_Led):
    """The pace: 0.25, 0.5, 1, 2, 4, 8 or 16."""

    do: Literal["rate"]
    rate: Annotated[float, Field(allow_inf_nan=False, gt=0, le=100)]


class SeekReplayAlarm(_Order):
    """To the alarm after (1) or before (−1) this moment."""

    do: Literal["alarm"]
    direction: Literal[-1, 1]


ReplayOrder = (
    OpenReplay
    | OpenBeside
    | CloseBeside
    | LeaveReplay
    | SeekReplay
    | PlayReplay
    | PauseReplay
    | SetReplayRate
    | SeekReplayAlarm
)
_ORDERS: TypeAdapter[ReplayOrder] = TypeAdapter(Annotated[ReplayOrder, Field(discriminator="do")])


class NotUnderstood(ValueError):
    """`str()` is one sentence."""


def read(message: Any) -> ReplayOrder:
    """The order in a decoded JSON value. Raises NotUnderstood."""
    try:
        return _ORDERS.validate_python(message)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
            raise NotUnderstood("A replay has no such command.") from None
        where = ".".join(str(part) for part in first["loc"][1:]) or "the order"
        raise NotUnderstood(f"{where}: {first['msg']}.") from None


def opening(recording: str | None, moment: str | None) -> OpenReplay | None:
    """From an address: a moment that is none is the beginning, and what cannot be a recording's id is looked for like
    any other, so that its page reports that there is none."""
    if recording is None:
        return None
    try:
        at_s = float(moment) if moment is not None else 0.0
    except ValueError:
        at_s = 0.0
    at_s = min(max(at_s, 0.0), 1e9) if at_s == at_s else 0.0
    return OpenReplay(kind="replay", do="open", recording=recording[:120] or "?", at_s=at_s)
