"""Settings that a recording is judged with, laid over the car's profile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from server.judge import profiles
from server.judge.active_settings import ActiveSettings
from server.judge.message import RosVersion
from server.judge.settings import AUTO, BadSetting, SettingsFile, from_toml, salvage

MOST_LEFT_OUT = 10  # sentences of one file


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsOverride:
    """Settings of a file or a recording; everything else stays as the car's profile has it."""

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
