"""Who is called when something new of a vehicle is there."""

from __future__ import annotations

from collections.abc import Callable

from server.bus.bus import ALL, Watcher


class Watchers:
    """Viewers, who are called with each kind of frame and with "events", and those who follow events only."""

    def __init__(self) -> None:
        self._viewers: dict[str, dict[int, Watcher]] = {}
        self._followers: dict[str, dict[int, Watcher]] = {}
        self._next = 0

    @property
    def viewed(self) -> tuple[str, ...]:
        """What has a viewer: vehicles, and `ALL`."""
        return tuple(self._viewers)

    def viewers(self, vehicle: str) -> int:
        return len(self._viewers.get(vehicle, ()))

    def view(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(kind)`; answers how to end that."""
        return self._add(self._viewers, vehicle, watcher)

    def follow(self, vehicle: str, watcher: Watcher) -> Callable[[], None]:
        """Calls `watcher(name)` with the name of the vehicle that has new events; answers how to end that."""
        return self._add(self._followers, vehicle, watcher)

    def wake(self, vehicle: str, kind: str) -> None:
        for watcher in tuple(self._viewers.get(vehicle, {}).values()):
            watcher(kind)
        if kind == "events":
            for whose in (vehicle, ALL):
                for watcher in tuple(self._followers.get(whose, {}).values()):
                    watcher(vehicle)

    def _add(self, of: dict[str, dict[int, Watcher]], vehicle: str, watcher: Watcher) -> Callable[[], None]:
        self._next += 1
        key = self._next
        of.setdefault(vehicle, {})[key] = watcher

        def leave() -> None:
            here = of.get(vehicle, {})
            here.pop(key, None)
            if not here:
                of.pop(vehicle, None)

        return leave
