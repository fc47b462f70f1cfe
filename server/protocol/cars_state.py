"""The `cars` frame: the cars of a server that watches several, each in a few numbers."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from monitor.alarm import AlarmState
from monitor.alarm_spec import Priority, Sound
from monitor.link import Phase
from monitor.recorder import RecorderState
from server.protocol.doc import doc
from server.protocol.signal_state import SignalFreshness
from server.protocol.slow_down_state import SlowDownPhase
from server.protocol.state import Cut


class CarAlarm(TypedDict):
    """The worst alarm of a car."""

    id: str
    occurrence: int
    title: str
    priority: Priority
    state: AlarmState
    active: bool
    raised_ms: int
    sound: Annotated[Sound, doc("none while it is silenced")]


class CarLink(TypedDict):
    """What the chain of a car is made of, as in LinkState and SessionState."""

    cut: Cut | None
    bridge_age_s: float | None
    car_age_s: float | None
    trying_for_s: float
    connected_for_s: float | None


class CarSpeed(TypedDict):
    value_mps: float | None
    freshness: SignalFreshness
    age_s: float | None
    horizon_s: float | None


class CarSummary(TypedDict):
    """One car, as its session states it."""

    phase: Phase
    paused: bool
    link: CarLink
    worst: Annotated[CarAlarm | None, doc("unacknowledged before acknowledged, then by priority, then the newest")]
    waiting: Annotated[int, doc("alarms that nobody has acknowledged")]
    speed: CarSpeed
    holder: Annotated[str | None, doc("name of who is in control; null: nobody")]
    page: Annotated[str | None, doc("the page that is")]
    recording: RecorderState
    recording_for_s: float | None
    slow_down: SlowDownPhase


class ListedCar(TypedDict):
    name: str
    age_s: Annotated[float | None, doc("of the summary when this was sent; null: there was none in this run")]
    summary: Annotated[CarSummary | None, doc("null: its session has stopped, and nothing is known of the car now")]


class Cars(TypedDict):
    """All cars of a server that watches several: twice a second, and at once when the alarms of one change."""

    kind: Literal["cars"]
    time_ms: int
    cars: list[ListedCar]
