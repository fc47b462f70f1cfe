"""Finds every check and composes every threshold: the only discovery in the code base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

from pydantic import Field, ValidationError, create_model

from monitor import checks as _checks
from monitor.check import EXPERT, Check, Limits
from monitor.instruments import GROUPS

AnyCheck = Check[Any]


def load() -> tuple[AnyCheck, ...]:
    """Every check of monitor/checks, in the order of the home tab; raises ValueError where two have one id."""
    found: dict[str, AnyCheck] = {}
    for module in sorted(iter_modules(_checks.__path__), key=lambda module: module.name):
        for check in import_module(f"{_checks.__name__}.{module.name}").CHECKS:
            if check.id in found:
                raise ValueError(f"two checks are named {check.id}")
            found[check.id] = check
    return tuple(sorted(found.values(), key=lambda check: check.order))


def compose(checks: Sequence[AnyCheck]) -> type[Limits]:
    """A model with one field for each group of thresholds, which checks of one family share."""
    groups: dict[str, type[Limits]] = dict(GROUPS)
    for check in checks:
        if groups.setdefault(check.limits_group, check.limits) is not check.limits:
            raise ValueError(f"two classes of limits are named {check.limits_group}")
    fields: dict[str, Any] = {
        group: (limits, Field(default_factory=limits)) for group, limits in groups.items() if limits.model_fields
    }
    return create_model("AllLimits", __base__=Limits, __doc__="Every threshold, in SI.", **fields)


CHECKS = load()

if TYPE_CHECKING:

    class AllLimits(Limits):
        """Every threshold, in SI; what fields there are follows from the checks."""

        def __getattr__(self, group: str) -> Any: ...

else:
    AllLimits = compose(CHECKS)


def flat(limits: Limits) -> dict[str, float]:
    """Every threshold by its full name: {"speed_limit.max_mps": 11.0, …}."""
    return {f"{group}.{name}": value for group, values in limits.model_dump().items() for name, value in values.items()}


def changed(limits: AllLimits, values: Mapping[str, Any]) -> AllLimits:
    """`limits` with some thresholds, by full name, replaced.

    Raises pydantic.ValidationError which names the field at fault: its `loc` is ("speed_limit", "max_mps").
    """
    tree: dict[str, Any] = limits.model_dump()
    for name, value in values.items():
        group, _, field = name.partition(".")
        tree.setdefault(group, {})[field] = value
    return type(limits).model_validate(tree)


@lru_cache(maxsize=1)
def schema() -> dict[str, dict[str, Any]]:
    """Every threshold by its full name with title, description, unit, default, minimum, maximum and heading, in the
    order of Settings: that of the tiles, then what belongs to no check, then what is for experts."""
    tiles: dict[str, str] = {}
    for check in CHECKS:
        tiles.setdefault(check.limits_group, check.tile_label)
    places = {group: place for place, group in enumerate(tiles)}
    groups = sorted(AllLimits(), key=lambda row: places.get(row[0], len(places)))
    found = {
        f"{group}.{name}": {"heading": tiles.get(group, group)} | field
        for group, limits in groups
        for name, field in limits.model_json_schema()["properties"].items()
    }
    return dict(sorted(found.items(), key=lambda row: row[1]["heading"] == EXPERT))


__all__ = ["CHECKS", "AllLimits", "AnyCheck", "ValidationError", "changed", "compose", "flat", "load", "schema"]
