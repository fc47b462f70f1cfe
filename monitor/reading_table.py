"""The newest readings and the ranges of all signals, which snapshots share without a copy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from monitor.reading import Extent, Reading


class ReadingTable:
    """Copies on write: what a snapshot shares is copied before the next change."""

    __slots__ = ("_extents", "_extents_shared", "_readings_shared", "newest")

    def __init__(self) -> None:
        self.newest: dict[str, Reading[Any]] = {}  # by signal; to read, `put` and `drop` alone change it
        self._extents: dict[str, Extent] = {}
        self._readings_shared: Mapping[str, Reading[Any]] | None = None
        self._extents_shared: Mapping[str, Extent] | None = None

    def put(self, signal: str, reading: Reading[Any]) -> None:
        """Replace the newest reading of a signal."""
        if self._readings_shared is not None:
            self.newest = self.newest.copy()
            self._readings_shared = None
        self.newest[signal] = reading

    def drop(self, signal: str) -> None:
        """Forget the newest reading of a signal."""
        self.newest = {name: reading for name, reading in self.newest.items() if name != signal}
        self._readings_shared = None

    def forget(self, signal: str) -> None:
        """Forget the newest reading of a signal, and its range."""
        if signal in self.newest:
            self.drop(signal)
        if signal in self._extents:
            self._extents = {name: extent for name, extent in self._extents.items() if name != signal}
            self._extents_shared = None

    def age(self, signal: str, received_s: float, delay_s: float) -> None:
        """The reading that came at `received_s`, and what was derived from it, was so old when it came."""
        for name, reading in self.newest.items():
            is_of_it = signal in (name, reading.derived_from) and reading.received_s == received_s
            if is_of_it and reading.delay_s != delay_s:
                self.put(name, replace(reading, delay_s=delay_s))

    def put_extent(self, signal: str, lowest: float, highest: float) -> None:
        """Replace the range of a signal's headline number."""
        if self._extents_shared is not None:
            self._extents = self._extents.copy()
            self._extents_shared = None
        self._extents[signal] = Extent(lowest=lowest, highest=highest)

    def is_fresh(self, signal: str, now_s: float) -> bool:
        """Whether a signal has a reading to judge by at `now_s`."""
        reading = self.newest.get(signal)
        return reading is not None and reading.is_fresh(now_s)

    def shift(self, by_s: float) -> None:
        """Move the times of all readings, so that their ages survive a clock that went back."""
        self.newest = {
            name: replace(reading, received_s=reading.received_s + by_s) for name, reading in self.newest.items()
        }
        self._readings_shared = None

    def readings(self) -> Mapping[str, Reading[Any]]:
        """The newest readings as they are now; later changes do not reach this mapping."""
        shared = self._readings_shared
        if shared is None:
            shared = self._readings_shared = MappingProxyType(self.newest)
        return shared

    def extents(self) -> Mapping[str, Extent]:
        """The ranges as they are now; later changes do not reach this mapping."""
        shared = self._extents_shared
        if shared is None:
            shared = self._extents_shared = MappingProxyType(self._extents)
        return shared
