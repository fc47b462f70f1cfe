"""Which topic of a car carries which signal. Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from server.judge.topics import COMMAND, Source, map_signals


class SignalMap:
    """Of one car, over all openings of its link."""

    def __init__(self) -> None:
        self.sources: Mapping[str, Source] = {}  # by signal
        self.unmapped: Mapping[str, str] = {}  # topic → type of what carries no signal
        self.offers_nothing = False  # no topic of the car can be read

    def update(self, offered: Mapping[str, str], picked: Mapping[str, str], unpublished: Collection[str]) -> None:
        """Chooses the topic of each signal. `offered`: topic → type; `picked`: signal → topic, by an operator."""
        sources = map_signals(offered, picked, unpublished)
        gone = {s: source for s, source in self.sources.items() if s not in sources and source.topic not in offered}
        self.sources = gone | sources  # a topic that vanished stays subscribed: it may come back
        mapped = {source.topic for source in self.sources.values()}
        self.unmapped = {name: kind for name, kind in offered.items() if name not in mapped}
        self.offers_nothing = not any(source.decode for source in self.sources.values())

    @property
    def command_topic(self) -> str | None:
        """Where others command the car."""
        source = self.sources.get(COMMAND)
        return source.topic if source is not None else None
