"""Whether two receivers can be at one place, and whether two tracks are one: only the statistics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from monitor.geo import offset_m

PHONE_SIGMA_FLOOR_M = 2.0
RADIUS_68_SIGMAS = 1.51  # a circle of so many sigmas holds 68 % of a normal distribution in two dimensions
CHI_SQUARE = 13.8  # 99.9 % with 2 degrees of freedom: −2 ln 0.001
LEVER_ARM_M = 2.0  # between the car's antenna and a phone somewhere in the car, in any direction


def phone_sigma_m(accuracy_m: float) -> float:
    """One-sigma error [m] per axis of a phone that states `accuracy_m`.

    The Geolocation standard defines 95 %, but Android and iOS use the radius of 68 %: √(−2 ln 0.32) = 1.51 sigmas. No
    phone is better than 2 m.
    """
    return max(PHONE_SIGMA_FLOOR_M, accuracy_m / RADIUS_68_SIGMAS)


def gate_m(
    east_m: float,
    north_m: float,
    *,
    car_sigma_m: float,
    phone_sigma_m: float,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
    uncertain_s: float = 0.0,
) -> float:
    """How far apart [m] in the direction (east, north) the errors of both receivers can bring one place.

    The chi-square gate dᵀΣ⁻¹d ≤ 13.8 (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and
    Navigation, 5.4), solved for the length of d. Σ = σ_car² I + σ_phone² I + (2 m)²/2 I + u uᵀ: the lever arm may point
    anywhere, so half its square falls on each axis; u = velocity · `uncertain_s` is how far the car drives while the
    moment is uncertain. Σ = s I + u uᵀ is inverted after Sherman and Morrison, (I − u uᵀ/(s + |u|²))/s.
    """
    s = car_sigma_m**2 + phone_sigma_m**2 + LEVER_ARM_M**2 / 2
    u_east, u_north = velocity_mps[0] * uncertain_s, velocity_mps[1] * uncertain_s
    distance_m = math.hypot(east_m, north_m)
    along_m = (east_m * u_east + north_m * u_north) / distance_m if distance_m > 0.0 else 0.0
    return math.sqrt(CHI_SQUARE * s / (1.0 - along_m**2 / (s + u_east**2 + u_north**2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Where the phone and the car were at one moment, WGS84."""

    at_s: float
    phone_lat_deg: float
    phone_lon_deg: float
    phone_sigma_m: float
    car_lat_deg: float
    car_lon_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """Two tracks over one time, beside each other."""

    pairs: int
    span_s: float
    car_spread_m: float  # root of the mean square distance from the mean place
    phone_spread_m: float
    phone_sigma_m: float  # root of the mean square
    correlation: float | None  # −1 … 1; None: one of them did not move at all


def correlate(pairs: Sequence[Pair]) -> Tracks:
    """The pooled correlation of two tracks, r = Σ dp·dq / √(Σ|dp|² Σ|dq|²).

    p and q are the positions of phone and car, east and north [m] from one origin; dp, dq their differences from the
    means; both axes are pooled, so that r does not depend on the direction of the road. r ignores a constant offset,
    which the gate detects, and is meaningless for tracks shorter than the errors.
    """
    if not pairs:
        return Tracks(pairs=0, span_s=0.0, car_spread_m=0.0, phone_spread_m=0.0, phone_sigma_m=0.0, correlation=None)
    origin = pairs[0].car_lat_deg, pairs[0].car_lon_deg
    p = _centred([offset_m(*origin, pair.phone_lat_deg, pair.phone_lon_deg) for pair in pairs])
    q = _centred([offset_m(*origin, pair.car_lat_deg, pair.car_lon_deg) for pair in pairs])
    pp = sum(east * east + north * north for east, north in p)
    qq = sum(east * east + north * north for east, north in q)
    pq = sum(a[0] * b[0] + a[1] * b[1] for a, b in zip(p, q, strict=True))
    scale = math.sqrt(pp) * math.sqrt(qq)
    n = len(pairs)
    return Tracks(
        pairs=n,
        span_s=pairs[-1].at_s - pairs[0].at_s,
        car_spread_m=math.sqrt(qq / n),
        phone_spread_m=math.sqrt(pp / n),
        phone_sigma_m=math.sqrt(sum(pair.phone_sigma_m**2 for pair in pairs) / n),
        correlation=max(-1.0, min(1.0, pq / scale)) if scale > 0.0 else None,
    )


def _centred(places: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    n = len(places)
    east_m, north_m = sum(place[0] for place in places) / n, sum(place[1] for place in places) / n
    return [(east - east_m, north - north_m) for east, north in places]
