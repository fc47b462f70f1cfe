"""How far the car may have driven since a value was measured; static/js/core/unseen.js does the same at the page.

The bound holds for every drive that begins with the last known speed and never accelerates more than the limit,
forwards or backwards: |v|·t + a·t²/2.
"""

from __future__ import annotations

import math

from monitor.check import Limits, threshold

# The German regulation on remote driving (StVFernLV) accepts 200 ms at 50 km/h: that is 2.78 m.
HEADING = "Metres unseen"


class UnseenLimits(Limits):
    acceleration_mps2: float = threshold(
        3.0,
        "Acceleration at most",
        unit="m/s²",
        low=0.5,
        high=15.0,
        step=0.1,
        help="What the car can do. By it and the last speed the page counts how far the car may have driven since "
        "the last value.",
        heading=HEADING,
    )
    proposes_speed: float = threshold(
        0.0,
        "Propose a speed on a late link",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: while values are more than 200 ms late, the gauge shows the speed at which the car drives 2.78 m in "
        "that time (StVFernLV).",
        heading=HEADING,
    )


def unseen_m(speed_mps: float | None, age_s: float | None, acceleration_mps2: float | None) -> float | None:
    """The most metres that the car can have driven since its speed was measured; None: not known, never 0 for it.

    `speed_mps`: the last one, with any sign; `age_s`: how old it is, its transport included; `acceleration_mps2`: the
    most that the car can do.
    """
    if speed_mps is None or age_s is None or acceleration_mps2 is None:
        return None
    found_m = abs(speed_mps) * age_s + acceleration_mps2 * age_s * age_s / 2
    is_known = math.isfinite(found_m) and math.isfinite(speed_mps) and age_s >= 0.0 and acceleration_mps2 > 0.0
    return found_m if is_known else None


def unseen_words(metres: float | None) -> str:
    """A bound as text, never rounded down: "≤ 2.8 m unseen"."""
    if metres is None:
        return "distance driven unknown"
    if metres > 999.0:
        return f"≤ {_up(metres / 1000):.1f} km unseen"
    return f"≤ {math.ceil(metres):.0f} m unseen" if metres > 99.9 else f"≤ {_up(metres):.1f} m unseen"


def _up(number: float) -> float:
    """To one decimal, up."""
    return math.ceil(number * 10) / 10
