"""The `signals` of a state: what is known of each signal, and the fields of its value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Generic, Literal, NotRequired, TypeVar

from typing_extensions import TypeAliasType, TypedDict

from monitor.reading import Freshness
from monitor.signals import SIGNALS
from monitor.values import Mode
from server.protocol.doc import doc


class SpeedValue(TypedDict):
    speed_mps: Annotated[float | None, doc("forward +")]
    yaw_rate_radps: Annotated[float | None, doc("counter-clockwise; null: the car does not send it")]


class AccelerationValue(TypedDict):
    acceleration_mps2: float | None
    source: Annotated[Literal["topic", "speed"], doc("speed: derived from the speed")]


class PedalValue(TypedDict):
    percent: float | None


class SteeringValue(TypedDict):
    percent: Annotated[float | None, doc("negative: left")]
    tyre_rad: Annotated[float | None, doc("angle of the front tyres, positive: left; null: not known for this car")]


class DistanceValue(TypedDict):
    distance_m: Annotated[float | None, doc("null: none in range")]
    none_in_range: bool


class BearingValue(TypedDict):
    bearing_rad: Annotated[float | None, doc("counter-clockwise, 0 ahead; null: unknown")]


class PositionValue(TypedDict):
    lat_deg: float | None
    lon_deg: float | None
    alt_m: float | None
    status: Annotated[int, doc("−1: no fix")]
    sigma_m: Annotated[float | None, doc("null: quality unknown")]
    covariance_m2: Annotated[tuple[float, float, float] | None, doc("east, north, east-north")]


class OdometryValue(TypedDict):
    x_m: float | None
    y_m: float | None
    yaw_rad: float | None
    speed_mps: float | None


class HeadingValue(TypedDict):
    heading_deg: Annotated[float | None, doc("0 north, clockwise")]
    source: Literal["topic", "odometry", "track"]


class ScanValue(TypedDict):
    beams: int
    usable: int
    angle_min_rad: float | None
    angle_increment_rad: float | None
    range_min_m: float | None
    range_max_m: float | None
    nearest_m: float | None
    nearest_bearing_rad: float | None
    frame_id: str
    laser_ahead_m: NotRequired[
        Annotated[float | None, doc("of the rear axle, by the transforms; null: as the setting has it")]
    ]
    laser_left_m: NotRequired[Annotated[float | None, doc("of the centre line")]]
    mounting: NotRequired[
        Annotated[
            str | None,
            doc("*laser assumed to look ahead*, *gap from the laser: no bumper set*: limits of its view of the road"),
        ]
    ]


class ComponentState(TypedDict):
    name: str
    level: Annotated[int, doc("0 OK, 1 warning, 2 error, 3 stale")]
    message: str


class DiagnosticsValue(TypedDict):
    worst: Annotated[int, doc("0 … 3")]
    components: Annotated[list[ComponentState], doc("at most 50, the worst first")]


class CommandValue(TypedDict):
    speed_mps: Annotated[float | None, doc("null: unknown")]
    tyre_angle_rad: Annotated[float | None, doc("null: unknown")]


class FuelValue(TypedDict):
    value: float | None
    unit: Annotated[str, doc("% or l")]


class ModeValue(TypedDict):
    mode: Annotated[Mode, doc("of a plain number always unknown: what it means is a setting")]
    said: Annotated[str, doc("as the car states it")]


class NumberValue(TypedDict):
    value: Annotated[float | None, doc("in the unit of the signal")]


SignalValue = (
    SpeedValue
    | AccelerationValue
    | PedalValue
    | SteeringValue
    | DistanceValue
    | BearingValue
    | PositionValue
    | OdometryValue
    | HeadingValue
    | ScanValue
    | DiagnosticsValue
    | CommandValue
    | FuelValue
    | ModeValue
    | NumberValue
)
Value = TypeVar("Value")
SignalFreshness = TypeAliasType(
    "SignalFreshness", Freshness | Literal["not_measured", "no_value", "never", "not_published"]
)


class SignalState(TypedDict, Generic[Value]):
    """One signal."""

    label: str
    unit: Annotated[str, doc("of the headline number; empty: it has none, or its unit is not known")]
    freshness: Annotated[
        SignalFreshness,
        doc(
            "ageing: > 3 periods; stale: > max(10 periods, 1 s); not_measured: messages came, which declare that; "
            "no_value: messages came, none of which could be used; never: subscribed to, and nothing came"
        ),
    ]
    age_s: Annotated[float | None, doc("since it came")]
    delay_s: Annotated[float | None, doc("how old it was when it came, at most")]
    horizon_s: Annotated[float | None, doc("the age at which it is stale")]
    period_s: float | None
    expected_hz: float | None
    rate_hz: float | None
    topic: str | None
    type: str | None
    why: Annotated[str | None, doc("why this topic carries the signal; null: none does")]
    frame: Annotated[str | None, doc("the frame that its messages name; null: none, or not known")]
    note: Annotated[str | None, doc('"Float64, expected Float32: reading it as Float64"')]
    unusable: Annotated[str | None, doc('why the newest messages cannot be used: "not a number (linear.x)"')]
    count: int
    rejected: int
    rejected_why: str | None
    repaired: Annotated[int, doc("messages that were corrected when they were read")]
    repaired_why: str | None
    value: Annotated[Value | None, doc("null: nothing came; its fields: below")]
    lowest: Annotated[float | None, doc("of the headline number since connecting; null where there is none")]
    highest: float | None


# The value of each signal that is more than one number.
VALUES: Mapping[str, type] = {
    "speed": SpeedValue,
    "acceleration": AccelerationValue,
    "brake": PedalValue,
    "accelerator": PedalValue,
    "steering": SteeringValue,
    "distance": DistanceValue,
    "bearing": BearingValue,
    "position": PositionValue,
    "odometry": OdometryValue,
    "heading": HeadingValue,
    "scan": ScanValue,
    "diagnostics": DiagnosticsValue,
    "command": CommandValue,
    "fuel": FuelValue,
    "mode": ModeValue,
}
if TYPE_CHECKING:
    Signals = dict[str, SignalState[SignalValue]]
else:  # one for each declared signal, always all of them
    Signals = TypedDict("Signals", {name: SignalState[VALUES.get(name, NumberValue)] for name in SIGNALS})
