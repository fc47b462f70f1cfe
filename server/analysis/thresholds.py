"""Reads a settings file for an analysis, and reports what is wrong with each invalid key."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from monitor import catalog
from monitor.signals import SIGNALS
from server.judge import profiles
from server.judge.active_settings import SettingsOverride
from server.judge.profiles import GENERIC
from server.judge.settings import AUTO, BadSetting, Settings, change
from server.storage import bounded_toml

_SECTIONS = ("version", "profile", "topics", "units", "limits")


class BadSettingsFile(Exception):
    """The file cannot be used; `sentences` say why, one for each thing that is wrong."""

    def __init__(self, *sentences: str) -> None:
        super().__init__(" ".join(sentences))
        self.sentences = sentences


def read_override(path: Path) -> SettingsOverride:
    """A file of [group] tables, or a file that catgraph exported, where they are below [limits].

    Raises BadSettingsFile.
    """
    body = _body(path)
    wrong: list[str] = []
    values = _values(path, _tables(path, body, wrong), wrong)
    topics = _topics(path, body.get("topics", {}), wrong)
    units = _units(path, body.get("units", {}), wrong)
    profile = body.get("profile", AUTO)
    known = (AUTO, *profiles.load())
    if profile not in known:
        wrong.append(f"{path}: profile: known are {_listed(known)}, not {_shown(profile)}.")
    if wrong:
        raise BadSettingsFile(*wrong)
    return SettingsOverride(name=path.name, values=values, topics=topics, units=units, profile=str(profile))


def _body(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:  # not all of it: it may be a device without end
            raw = file.read(bounded_toml.MAX_BYTES + 1)
    except OSError as error:
        raise BadSettingsFile(f"{path} cannot be read: {error.strerror or error}.") from None
    try:
        return bounded_toml.loads(raw)
    except bounded_toml.BadToml as why:
        raise BadSettingsFile(f"{path}: {why}") from None


def _tables(path: Path, body: Mapping[str, Any], wrong: list[str]) -> dict[str, Any]:
    """Group → its table, from both places where a file may have them."""
    limits = body.get("limits", {})
    if not isinstance(limits, dict):
        wrong.append(f"{path}: limits: this is a table of tables, such as [limits.speed_limit].")
        limits = {}
    return limits | {name: table for name, table in body.items() if name not in _SECTIONS}


def _values(path: Path, tables: Mapping[str, Any], wrong: list[str]) -> dict[str, float]:
    schema = catalog.schema()
    groups = {name.partition(".")[0] for name in schema}
    values: dict[str, float] = {}
    for group, table in tables.items():
        if group not in groups:
            wrong.append(f"{path}: [{_shown(group)}]: unknown group of settings{_guess(group, groups)}.")
            continue
        if not isinstance(table, dict):
            wrong.append(f"{path}: {group}: this is a group of settings: write [{group}], and its settings below.")
            continue
        for threshold, value in table.items():
            name = f"{group}.{threshold}"
            if name not in schema:
                wrong.append(f"{path}: {_shown(name)}: unknown setting{_guess(name, schema)}.")
                continue
            try:
                change(Settings(), GENERIC, values={name: value})
            except BadSetting as why:
                wrong.append(f"{path}: {name} = {_shown(value)}: {why}")
                continue
            values[name] = value
    return values


def _topics(path: Path, given: Any, wrong: list[str]) -> dict[str, str]:
    if not isinstance(given, dict):
        wrong.append(f"{path}: topics: this is a table of signals and their topics.")
        return {}
    topics: dict[str, str] = {}
    for signal, topic in given.items():
        if signal not in SIGNALS:
            wrong.append(f"{path}: topics.{_shown(signal)}: unknown signal{_guess(signal, SIGNALS)}.")
        elif not isinstance(topic, str) or not 1 <= len(topic) <= 300:
            wrong.append(f"{path}: topics.{signal}: a topic must be text.")
        else:
            topics[signal] = topic
    return topics


def _units(path: Path, given: Any, wrong: list[str]) -> dict[str, str]:
    if not isinstance(given, dict):
        wrong.append(f"{path}: units: this is a table of signals and their units.")
        return {}
    units: dict[str, str] = {}
    for signal, unit in given.items():
        try:
            units |= change(Settings(), GENERIC, units={signal: str(unit)}).units
        except BadSetting as why:
            wrong.append(f"{path}: units.{_shown(signal)}: {why}")
    return units


def _guess(name: str, known: Any) -> str:
    near = get_close_matches(name, list(known), n=1, cutoff=0.75)
    return f"; {near[0]} is near" if near else ""


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(names[:-1]) + " and " + names[-1]


def _shown(value: Any) -> str:
    text = str(value) if not isinstance(value, str) else value
    return text if len(text) <= 60 and text.isprintable() else repr(text[:60])
