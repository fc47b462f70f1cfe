"""What is known beforehand of a kind of car: its defaults, and how it is recognised by the topics it offers."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from monitor import catalog
from monitor.values import Mode
from server.judge.units import unit_named

SteeringUnit = Literal["percent", "tyre_angle", "unknown"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """One kind of car."""

    name: str
    title: str
    steering: SteeringUnit = "unknown"  # what torque.z of the steering topic means; its ratio is a threshold
    units: Mapping[str, str] = field(default_factory=dict)  # signal → name of the unit that a car of this kind has
    modes: Mapping[str, Mode] = field(default_factory=dict)  # names and numbers of its mode topic, in lower case
    limits: Mapping[str, float] = field(default_factory=dict)  # thresholds that differ from the checks' own defaults
    has: tuple[str, ...] = ()  # topics that a car of this kind has, whatever the case of their letters
    lacks: tuple[str, ...] = ()
    ros: int | None = None
    departure: tuple[Mapping[str, Any], ...] = ()  # items of its departure check; none: the usual one

    def fits(self, topics: frozenset[str], ros: int | None) -> bool:
        """Whether a car with these topics (lower case) may be of this kind."""
        return (
            all(name.lower() in topics for name in self.has)
            and not any(name.lower() in topics for name in self.lacks)
            and (self.ros is None or self.ros == ros)
        )


GENERIC = Profile(name="generic", title="Any car")


def load() -> dict[str, Profile]:
    """The profiles that are shipped, by name. Raises ValueError where one of them is wrong (a test loads them all)."""
    found = {GENERIC.name: GENERIC}
    for path in sorted(Path(__file__).parent.glob("*.toml")):
        profile = _read(path.stem, tomllib.loads(path.read_text(encoding="utf-8")))
        found[profile.name] = profile
    return found


def _read(name: str, body: Mapping[str, Any]) -> Profile:
    match = body.get("match", {})
    units = body.get("units", {})
    for signal, unit in units.items():
        if unit_named(signal, unit) is None:
            raise ValueError(f"{name}: {signal} has no unit {unit!r}")
    limits = {
        f"{group}.{threshold}": value
        for group, values in body.get("limits", {}).items()
        for threshold, value in values.items()
    }
    catalog.changed(catalog.AllLimits(), limits)  # raises ValueError for a threshold that is not there or out of range
    return Profile(
        name=name,
        title=body["title"],
        steering=body.get("steering", "unknown"),
        units=units,
        modes={name.casefold(): mode for mode in get_args(Mode) for name in body.get("mode", {}).get(mode, ())},
        limits=limits,
        has=tuple(match.get("has", ())),
        lacks=tuple(match.get("lacks", ())),
        ros=match.get("ros"),
        departure=tuple(body.get("departure", ())),
    )


def choose(profiles: Mapping[str, Profile], topics: Mapping[str, str], ros: int | None) -> Profile:
    """The best matching profile for a car with these topics; the generic one if none matches."""
    names = frozenset(name.lower() for name in topics)
    fitting = [profile for profile in profiles.values() if profile is not GENERIC and profile.fits(names, ros)]
    return max(fitting, key=lambda profile: len(profile.has) + len(profile.lacks), default=GENERIC)
