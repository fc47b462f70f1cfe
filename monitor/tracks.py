"""Where the car has been and how far it has driven, from positions that are never quite still."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoint:
    """One place the car was at."""

    at_s: float  # received
    lat_deg: float
    lon_deg: float
    distance_m: float  # driven until here


class Track:
    """To follow: bounded, decimated, noise-robust."""
