"""The newest report of every component on /diagnostics, where several nodes publish, each its own components."""

from __future__ import annotations

from monitor.values import Component, Diagnostics

SILENT_AFTER_S = 5.0  # as ROS's diagnostic aggregator
SILENT_PERIODS = 3  # for components that report slowly
FORGOTTEN_AFTER_S = 60.0  # a node that was ended on purpose does not alarm for ever
MOST = 1000
STALE = 3  # diagnostic_msgs/DiagnosticStatus


class Components:
    """Merges messages into one list of components; one that falls silent turns STALE, and is forgotten in the end."""

    def __init__(self) -> None:
        # By name: the newest report, its time, and the interval to the previous one.
        self._heard: dict[str, tuple[Component, float, float]] = {}

    def merge(self, said: Diagnostics, at_s: float) -> Diagnostics:
        """All components known after this message, in the order in which they first spoke."""
        for component in said.components:
            before = self._heard.get(component.name)
            if before is None and len(self._heard) >= MOST:
                continue
            period_s = at_s - before[1] if before is not None and at_s > before[1] else 0.0
            self._heard[component.name] = (component, at_s, period_s)
        self._heard = {name: word for name, word in self._heard.items() if -1.0 <= at_s - word[1] <= FORGOTTEN_AFTER_S}
        return Diagnostics(components=tuple(self._now(word, at_s) for word in self._heard.values()))

    @staticmethod
    def _now(word: tuple[Component, float, float], at_s: float) -> Component:
        component, heard_s, period_s = word
        silent_s = at_s - heard_s
        if silent_s <= max(SILENT_AFTER_S, SILENT_PERIODS * period_s):
            return component
        return Component(name=component.name, level=STALE, message=f"no report for {silent_s:.0f} s")
