"""How one vehicle is judged: its settings, the kind of car it was recognised as, and the thresholds that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

from monitor import catalog
from monitor.catalog import AllLimits
from server.judge import profiles
from server.judge.message import RosVersion
from server.judge.profiles import GENERIC, Profile
from server.judge.settings import (
    AUTO,
    BadSetting,
    Conflict,
    Settings,
    SettingsFile,
    change,
    differences,
    from_toml,
    salvage,
    to_toml,
)
from server.judge.units import UNITS
from server.protocol.answers import SettingField, SettingsAnswer

PERCENT_A_RAD = -1 / 0.00536  # the CATVehicle's steering: measured on its recordings, negative percent = left

MOST_LEFT_OUT = 10  # sentences of one file


class ActiveSettings:
    """The one owner of a vehicle's settings."""

    def __init__(self, file: SettingsFile) -> None:
        self._file = file
        self._profiles = profiles.load()
        self._recognised = GENERIC
        self.settings: Settings = file.read()
        self.complaint = file.complaint
        self._limits: tuple[Settings, Profile, AllLimits] | None = None  # as they follow from those two
        self._reported = self.in_force()

    def beside(self, suffix: str) -> Path | None:
        """A file beside that of the settings, of the same vehicle; None: nothing is kept on the disk."""
        return None if self._file.path is None else self._file.path.with_suffix(suffix)

    @property
    def profile(self) -> Profile:
        """The kind of car: what the operator chose, else what was recognised."""
        return self._profile_named(self.settings.profile)

    @property
    def limits(self) -> AllLimits:
        """Cached, because they are used many times a tick; recomputed only when their inputs change."""
        known, profile = self._limits, self.profile
        if known is None or known[0] is not self.settings or known[1] is not profile:
            known = self._limits = (self.settings, profile, self.settings.limits(profile))
        return known[2]

    def recognise(self, topics: Mapping[str, str], ros: int | None) -> bool:
        """Select the profile for the offered topics; True if it changed."""
        before = self.profile
        self._recognised = profiles.choose(self._profiles, topics, ros)
        return self.profile is not before

    def change(
        self,
        *,
        values: Mapping[str, float | None],
        topics: Mapping[str, str | None],
        units: Mapping[str, str | None] | None = None,
        profile: str | None,
        version: int | None,
    ) -> list[str]:
        """Stores changes and puts them in force; what changed, a line each. Raises BadSetting, Conflict, OSError."""
        new = self.prepare(values=values, topics=topics, units=units, profile=profile, version=version)
        self.store(new)
        return self.adopt(new)

    def prepare(
        self,
        *,
        values: Mapping[str, float | None],
        topics: Mapping[str, str | None],
        units: Mapping[str, str | None] | None = None,
        profile: str | None,
        version: int | None,
    ) -> Settings:
        """The settings with changes, for `store` and then `adopt`. Raises BadSetting, Conflict."""
        self._demand(version)
        return change(
            self.settings,
            self._profile_named(profile or self.settings.profile),  # a default of the new kind of car is not kept
            values=values,
            topics=topics,
            units=units,
            profile_name=profile,
            known_profiles=self._profiles,
        )

    def read(self, toml: str) -> Settings:
        """The settings in a file, for `prepare_all`; takes some 30 ms at most, on any thread. Raises BadSetting."""
        return from_toml(toml, self._recognised, self._profiles)

    def prepare_all(self, read: Settings) -> Settings:
        """As `prepare`, with all settings from a file that was read."""
        return replace(read, version=self.settings.version + 1)

    def number_on(self, version: int) -> bool:
        """Continue from a version of the log, because a number identifies one set of settings for ever. True where what
        was kept is older than that, so that something was lost."""
        if version <= self.settings.version:
            return False
        self.settings = replace(self.settings, version=version + 1)
        return True

    def in_force(self) -> dict[str, Any]:
        """Everything that is judged by: the kind of car, each threshold in SI, each topic and unit that was picked."""
        chosen = {"topics": dict(self.settings.topics), "units": dict(self.settings.units)}
        return {"profile": self.profile.name} | chosen | catalog.flat(self.limits)

    def changes(self) -> dict[str, list[Any]]:
        """Changes of the active settings since the last call: name → [from, to]; a topic is "topics.speed", a unit
        "units.brake"."""
        before, after = _flat(self._reported), _flat(now := self.in_force())
        self._reported = now
        names = sorted({*before, *after})
        return {name: [before.get(name), after.get(name)] for name in names if before.get(name) != after.get(name)}

    def as_toml(self) -> str:
        return to_toml(self.settings)

    def as_json(self) -> SettingsAnswer:
        """The response of `GET /api/settings`; `schema` has the possible settings, `defaults` those of the profile."""
        return {
            "version": self.settings.version,
            "profile": {
                "name": self.profile.name,
                "title": self.profile.title,
                "chosen": self.settings.profile,
                "recognised": self._recognised.title,
            },
            "profiles": [{"name": p.name, "title": p.title} for p in self._profiles.values()],
            "values": catalog.flat(self.limits),
            "defaults": catalog.flat(catalog.changed(catalog.AllLimits(), self.profile.limits)),
            "changed": sorted(self.settings.values),
            "topics": dict(self.settings.topics),
            "units": dict(self.settings.units),
            "unit_choices": {
                signal: [{"name": unit.name, "label": unit.label} for unit in units] for signal, units in UNITS.items()
            },
            "schema": cast(dict[str, SettingField], catalog.schema()),
        }

    def _profile_named(self, name: str) -> Profile:
        return self._recognised if name == AUTO else self._profiles.get(name, self._recognised)

    def store(self, new: Settings) -> None:
        """Writes prepared settings, on any thread: what is in force later is what a restart finds. Raises OSError."""
        if self._differences(new):
            self._file.write(new)

    def adopt(self, new: Settings) -> list[str]:
        """Puts stored settings in force; what changed, a line each."""
        lines = self._differences(new)
        if lines:
            self.settings = new
        return lines

    def _differences(self, new: Settings) -> list[str]:
        return differences(self.settings, new, self.profile, self._profile_named(new.profile))

    def _demand(self, version: int | None) -> None:
        if version is not None and version != self.settings.version:
            raise Conflict("Somebody else changed the settings meanwhile. Check them again.")


def _flat(in_force: Mapping[str, Any]) -> dict[str, Any]:
    chosen = {f"{part}.{signal}": name for part in ("topics", "units") for signal, name in in_force[part].items()}
    return {name: value for name, value in in_force.items() if name not in ("topics", "units")} | chosen


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsOverride:
    """Settings that a recording is judged with, laid over the car's profile.

    Settings of a file or a recording; everything else stays as the car's profile has it.
    """

    name: str = ""  # of the file
    values: Mapping[str, float] = field(default_factory=dict)  # "speed_limit.max_mps": 9.0
    topics: Mapping[str, str] = field(default_factory=dict)  # signal → topic
    units: Mapping[str, str] = field(default_factory=dict)  # signal → name of its unit
    profile: str = AUTO


NO_CHOICES = SettingsOverride()


def recorded_override(toml: str) -> tuple[SettingsOverride, list[str]]:
    """What can be used of the settings in a recording, and a sentence for each that cannot."""
    left_out: list[str] = []
    try:
        read = from_toml(toml)
    except BadSetting:
        read, found = salvage(toml, profiles.load())
        left_out = [f"The settings cannot be used as they are: {why}" for why in found[:MOST_LEFT_OUT]]
    override = SettingsOverride(
        name="as recorded", values=read.values, topics=read.topics, units=read.units, profile=read.profile
    )
    return override, left_out


def tuning_for(override: SettingsOverride, topics: Mapping[str, str], ros: RosVersion) -> ActiveSettings:
    """How a car with these topics is judged: its profile as live recognises it, then the override."""
    tuning = ActiveSettings(SettingsFile(None))
    tuning.recognise(topics, ros)
    if override.topics or override.units or override.profile != AUTO:
        topics, units = dict(override.topics), dict(override.units)
        tuning.change(values={}, topics=topics, units=units, profile=override.profile, version=None)
    if override.values:  # after the profile: what is kept of them is what differs from its defaults
        tuning.change(values=dict(override.values), topics={}, profile=None, version=None)
    return tuning
