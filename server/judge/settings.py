"""An operator's settings for one vehicle: thresholds, topics, profile; a TOML file, replaced as a whole.

Only differences from the profile's defaults are stored, so that a better default reaches an unchanged car.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from monitor import catalog
from monitor.catalog import AllLimits
from monitor.signals import SIGNALS
from server.judge import profiles
from server.judge.profiles import GENERIC, Profile
from server.judge.units import UNITS
from server.storage import bounded_toml, durable_file
from server.storage.durable_file import set_aside

log = logging.getLogger("catgraph.settings")

AUTO = "auto"  # the profile follows from what the car offers
MAX_TOML_BYTES = bounded_toml.MAX_BYTES
_MAX_VERSION = 2**53  # a larger one is not exact in JSON on a page
_HUGE = 1e12
_SECTIONS = {"version", "profile", "topics", "units", "limits"}
_MOST_NAMED = 5  # things left out that a complaint names


class BadSetting(ValueError):
    """A value that cannot be set; `str()` is one sentence, `field` its full name."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(sentence)
        self.field = field


class Conflict(Exception):
    """The settings were changed by another client in between."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """One version of a vehicle's settings; immutable."""

    version: int = 0
    profile: str = AUTO
    values: Mapping[str, float] = field(default_factory=dict)  # "speed_limit.max_mps": 9.0; only what was changed
    topics: Mapping[str, str] = field(default_factory=dict)  # signal → topic the operator picked
    units: Mapping[str, str] = field(default_factory=dict)  # signal → name of the unit the operator picked

    def limits(self, profile: Profile) -> AllLimits:
        """The thresholds in force for a car of that kind."""
        return catalog.changed(catalog.AllLimits(), {**profile.limits, **self.values})


def change(
    settings: Settings,
    profile: Profile,
    *,
    values: Mapping[str, float | None] | None = None,
    topics: Mapping[str, str | None] | None = None,
    units: Mapping[str, str | None] | None = None,
    profile_name: str | None = None,
    known_profiles: Mapping[str, Profile] | None = None,
) -> Settings:
    """The next version. A value, topic or unit of None is reset to its default. Raises BadSetting with the field."""
    new_values = {**settings.values}
    for name, value in (values or {}).items():
        if value is None:
            new_values.pop(name, None)
        else:
            new_values[name] = value
    _validate({**profile.limits, **new_values}, named=values or {})
    defaults = catalog.flat(catalog.changed(catalog.AllLimits(), profile.limits))
    kept = {name: float(value) for name, value in new_values.items() if defaults.get(name) != value}
    new_topics = {**settings.topics}
    for signal, topic in (topics or {}).items():
        if signal not in SIGNALS:
            raise BadSetting(_seen(f"topics.{signal}"), f"There is no signal named {_seen(signal)}.")
        if topic is None:
            new_topics.pop(signal, None)
        elif not topic.strip() or len(topic) > 300 or not topic.isprintable():
            raise BadSetting(f"topics.{signal}", "A topic name has 1 to 300 printable characters.")
        else:
            new_topics[signal] = topic
    moved = {signal for signal in topics or {} if new_topics.get(signal) != settings.topics.get(signal)}
    new_units = {signal: unit for signal, unit in settings.units.items() if signal not in moved}  # it was of the topic
    for signal, unit in (units or {}).items():
        known = [row.name for row in UNITS.get(signal, ())]
        if unit is None:
            new_units.pop(signal, None)
        elif unit in known:
            new_units[signal] = unit
        else:
            raise BadSetting(_seen(f"units.{signal}"), f"The unit of {_seen(signal)} cannot be {_seen(unit)}.")
    chosen = settings.profile if profile_name is None else profile_name
    if chosen != AUTO and known_profiles is not None and chosen not in known_profiles:
        raise BadSetting("profile", f"There is no profile named {_seen(chosen)}.")
    return Settings(version=settings.version + 1, profile=chosen, values=kept, topics=new_topics, units=new_units)


def _validate(flat: Mapping[str, Any], *, named: Mapping[str, Any]) -> None:
    schema = catalog.schema()
    for name in named:
        if name not in schema:
            raise BadSetting(_seen(name), f"There is no setting named {_seen(name)}.")
    for name, value in flat.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise BadSetting(name, f"{_label(name)}: a number is required.")
        if abs(value) > _HUGE:  # an int of a thousand digits is no float
            raise BadSetting(name, _sentence(name, "too large"))
    try:
        catalog.changed(catalog.AllLimits(), flat)
    except ValidationError as error:
        fault = error.errors(include_url=False, include_context=False, include_input=False)[0]
        name = ".".join(str(part) for part in fault["loc"])
        raise BadSetting(name, _sentence(name, fault["msg"])) from None


def _seen(name: str) -> str:
    """A person's name as a message may repeat it: short, with printable and encodable characters only."""
    return "".join(letter if letter.isprintable() else "?" for letter in name[:60])


def _label(name: str) -> str:
    return str(catalog.schema().get(name, {}).get("title", name))


def _sentence(name: str, message: str) -> str:
    row = catalog.schema().get(name)
    if row is None:
        return f"{_seen(name)}: {message}."
    return f"{row['title']}: {row['minimum']:g} to {row['maximum']:g} {row['unit']} is allowed."


def differences(old: Settings, new: Settings, profile: Profile, new_profile: Profile | None = None) -> list[str]:
    """The changes between two versions, as lines for the log; `new_profile` if the profile changed."""
    before, after = catalog.flat(old.limits(profile)), catalog.flat(new.limits(new_profile or profile))
    lines = [
        f"{_label(name)}: {before[name]:g} → {after[name]:g} {catalog.schema()[name]['unit']}".rstrip()
        for name in after
        if before.get(name) != after[name]
    ]
    for signal in sorted({*old.topics, *new.topics}):
        if old.topics.get(signal) != new.topics.get(signal):
            lines.append(f"Topic of {SIGNALS[signal].label}: {new.topics.get(signal, 'as found')}")
    for signal in sorted({*old.units, *new.units}):
        if old.units.get(signal) != new.units.get(signal):
            lines.append(f"Unit of {SIGNALS[signal].label}: {_unit_label(signal, new.units.get(signal))}")
    if old.profile != new.profile:
        lines.append(f"Profile: {new.profile}")
    return lines


def _unit_label(signal: str, name: str | None) -> str:
    return next((unit.label for unit in UNITS.get(signal, ()) if unit.name == name), "as found")


def to_toml(settings: Settings) -> str:
    """The settings as a file for people: thresholds by group, in SI."""
    limits: dict[str, dict[str, float]] = {}
    for name, value in sorted(settings.values.items()):
        group, _, threshold = name.partition(".")
        limits.setdefault(group, {})[threshold] = value
    return tomli_w.dumps(
        {
            "version": settings.version,
            "profile": settings.profile,
            "topics": dict(sorted(settings.topics.items())),
            **({"units": dict(sorted(settings.units.items()))} if settings.units else {}),
            "limits": limits,
        }
    )


def from_toml(text: str, profile: Profile = GENERIC, known_profiles: Mapping[str, Profile] | None = None) -> Settings:
    """The settings in a file. Raises BadSetting with one sentence for whatever is wrong with it."""
    body = _toml(text)
    version = body.get("version", 0)
    if type(version) is not int or not 0 <= version <= _MAX_VERSION:
        raise BadSetting("version", "The version must be an integer.")
    values: dict[str, Any] = {}
    for group in _table(body, "limits"):
        for threshold, value in _table(body["limits"], group, within="limits.").items():
            values[f"{group}.{threshold}"] = value
    topics = _table(body, "topics")
    if not all(isinstance(topic, str) for topic in topics.values()):
        raise BadSetting("topics", "A topic must be text.")
    units = _table(body, "units")
    if not all(isinstance(unit, str) for unit in units.values()):
        raise BadSetting("units", "A unit must be text.")
    name = body.get("profile", AUTO)
    if not isinstance(name, str):
        raise BadSetting("profile", "The profile must be a name.")
    unknown = sorted(set(body) - _SECTIONS)
    if unknown:
        raise BadSetting(_seen(unknown[0]), f"There is no section named {_seen(unknown[0])}.")
    profile = (known_profiles or {}).get(name, profile)
    fresh = change(
        Settings(),
        profile,
        values=values,
        topics=topics,
        units=units,
        profile_name=name,
        known_profiles=known_profiles,
    )
    return replace(fresh, version=version)


def salvage(text: str, known_profiles: Mapping[str, Profile]) -> tuple[Settings, list[str]]:
    """What can be used of a file that as a whole cannot: another version of catgraph may know other settings and other
    ranges, and the rest of what the operator set must not be lost for that. And a sentence for each thing left out.
    """
    left_out: list[str] = []
    try:
        body = _toml(text)
    except BadSetting as why:
        return Settings(), [str(why)]
    settings = Settings()

    def take(part: Mapping[str, Any]) -> None:
        nonlocal settings
        try:
            found = from_toml(tomli_w.dumps({"profile": settings.profile, **part}), known_profiles=known_profiles)
        except BadSetting as why:
            left_out.append(str(why))
            return
        settings = replace(
            settings,
            profile=found.profile,
            values={**settings.values, **found.values},
            topics={**settings.topics, **found.topics},
            units={**settings.units, **found.units},
        )

    version = body.pop("version", 0)
    if type(version) is int and 0 <= version <= _MAX_VERSION:
        settings = replace(settings, version=version)
    for name in sorted(body, key=lambda name: name != "profile"):  # it determines the defaults of the others
        rows = body[name]
        if name == "limits" and isinstance(rows, dict):
            for group, thresholds in rows.items():
                if not isinstance(thresholds, dict):
                    take({name: {group: thresholds}})
                    continue
                for threshold, value in thresholds.items():
                    take({name: {group: {threshold: value}}})
        elif name in ("topics", "units") and isinstance(rows, dict):
            for signal, chosen in rows.items():
                take({name: {signal: chosen}})
        else:
            take({name: rows})
    return settings, left_out


def _toml(text: str) -> dict[str, Any]:
    try:
        return bounded_toml.loads(text)
    except bounded_toml.BadToml as why:
        raise BadSetting("", str(why)) from None


def _table(body: Mapping[str, Any], name: str, within: str = "") -> dict[str, Any]:
    table = body.get(name, {})
    if not isinstance(table, dict):
        raise BadSetting(_seen(within + name), f"[{_seen(within + name)}] is not a table.")
    return table


class SettingsFile:
    """Where one vehicle's settings are kept; without a path, in memory."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self._is_unread = False  # what the file holds is not known: it is set aside before anything is written
        self.complaint: str | None = None  # why what was found could not be used

    def read(self) -> Settings:
        """The stored settings, or the defaults; an unusable file is set aside, never overwritten. Its usable values are
        in force and stored again."""
        if self.path is None:
            return Settings()
        try:
            with open(self.path, encoding="utf-8") as file:
                text = file.read(MAX_TOML_BYTES + 1)
        except FileNotFoundError:
            return Settings()
        except OSError as why:
            self._is_unread = True
            self.complaint = f"The settings cannot be read ({why.strerror or why}); the defaults are in force."
            return Settings()
        except UnicodeDecodeError:
            return self._rescue(Settings(), ["It is not UTF-8 text."])
        known = profiles.load()
        try:
            return from_toml(text, known_profiles=known)
        except BadSetting:
            return self._rescue(*salvage(text, known))

    def _rescue(self, settings: Settings, left_out: list[str]) -> Settings:
        assert self.path is not None
        aside = self.path
        self._is_unread = True
        try:
            aside = set_aside(self.path)
            self._is_unread = False
            if settings != Settings():
                self.write(settings)
        except OSError:
            log.exception("settings not set aside or saved: path=%s", self.path)
        listed = " ".join(left_out[:_MOST_NAMED]) + (
            f" And {len(left_out) - _MOST_NAMED} more." if len(left_out) > _MOST_NAMED else ""
        )
        rest = "the rest is in force" if settings != Settings() else "the defaults are in force"
        self.complaint = f"The settings kept in {aside.name} cannot all be used; {rest}. {listed}"
        return settings

    def write(self, settings: Settings) -> None:
        """Keeps a version: whole or not at all, through a loss of power too. Raises OSError.

        A file that could not be read is set aside first; where that fails, nothing is written.
        """
        if self.path is None:
            return
        if self._is_unread:
            with contextlib.suppress(FileNotFoundError):
                log.warning("settings unreadable, set aside: path=%s aside=%s", self.path, set_aside(self.path))
            self._is_unread = False
        self.path.parent.mkdir(parents=True, exist_ok=True)
        durable_file.write(self.path, to_toml(settings).encode())
