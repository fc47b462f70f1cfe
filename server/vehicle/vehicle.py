"""Which car a session watches."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A vehicle to watch; without an address it waits for one from the connect screen."""

    name: str
    address: str | None = None


def is_name(text: str) -> bool:
    """Whether a vehicle may be called so; `cars` is the list of all of them."""
    return text.replace("-", "").replace("_", "").isalnum() and len(text) <= 40 and text != "cars"


def vehicle_from_text(text: str, *, index: int) -> Vehicle:
    """`NAME=ws://car:9090` or only the address. Raises ValueError with one sentence."""
    name, separator, address = text.partition("=")
    if not separator or "://" in name:
        name, address = ("car" if index == 0 else f"car{index + 1}"), text
    return named(name, address)


def named(name: str, address: str | None = None) -> Vehicle:
    """A vehicle of this name. Raises ValueError with one sentence where it is none."""
    if not is_name(name):
        raise ValueError(f"“{name[:40]}” is no name for a vehicle: use letters, digits, - and _.")
    return Vehicle(name=name, address=address)
