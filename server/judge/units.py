"""The units that a signal may be published in, declared once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One unit of a signal's headline number as a car may publish it."""

    name: str  # in settings and commands
    label: str  # as the operator reads it
    factor: float | None  # to the unit of `monitor.signals`; None: follows from the kind of car


SHARE = Unit(name="share", label="0 to 1", factor=100.0)
PERCENT = Unit(name="percent", label="0 to 100 %", factor=1.0)

UNITS: Mapping[str, tuple[Unit, ...]] = {
    "fuel": (SHARE, PERCENT),
    "brake": (SHARE, PERCENT),
    "accelerator": (SHARE, PERCENT),
}
