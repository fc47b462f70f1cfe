"""Which topic of a car carries which signal, and which further topics are compared meanwhile. Pure."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from monitor.signals import SIGNALS
from server.judge import pipeline
from server.judge.comparisons import comparison_sources, offers
from server.judge.shapes import type_of
from server.judge.sources.candidates import follow
from server.judge.sources.choice import Choice, choose
from server.judge.sources.evidence import Evidence, Place
from server.judge.topics import COMMAND, Source
from server.protocol.questions import Question, TopicOffer

ALL_CAME_S = 2.0  # after the first message: what is slower is no candidate at first
MOST_TOPICS = 200
NOTE = "subscribed by name: the bridge has no rosapi"

SEEN_S, SETTLED_S = 1.0, 2.0  # with messages of all candidates, or without, the operator is not prompted before


class TopicsByName:
    """The topics of a car whose bridge does not name them: those of the usual names of which messages come.

    Of one car. Times are on a monotonic clock, in seconds.
    """

    def __init__(self) -> None:
        self.found: dict[str, str] = {}  # topic → type, by the fields of its first message
        self._first_s: float | None = None
        self.is_used = False  # `found` was mapped

    def receive(self, topic: str, message: Any, picked: Mapping[str, str], now_s: float) -> bool:
        """A message of a topic that was subscribed to by its name; whether its topics are to be mapped by it."""
        if topic in self.found or len(self.found) >= MOST_TOPICS:
            return self.is_due(now_s)
        signal = next((signal for signal, name in picked.items() if name == topic), None)
        self.found[topic] = type_of(message, topic, signal)
        if self._first_s is None:
            self._first_s = now_s
        return self.is_used or signal is not None

    def is_due(self, now_s: float) -> bool:
        """Whether the topics are to be mapped for the first time."""
        return not self.is_used and self._is_complete(now_s)

    def offered(self, picked: Mapping[str, str], now_s: float) -> Mapping[str, str]:
        """The topics as a bridge would offer them (topic → type); while more may come within a moment only those that
        are compared with no others."""
        self.is_used = self.is_used or self._is_complete(now_s)
        chosen = picked.values()
        return self.found if self.is_used else {name: kind for name, kind in self.found.items() if name in chosen}

    def _is_complete(self, now_s: float) -> bool:
        return self._first_s is not None and now_s - self._first_s >= ALL_CAME_S

    def beside(self, used: Mapping[str, object]) -> dict[str, Source]:
        """The topics that are not used: they are subscribed to, and what they send is not judged."""
        return {
            topic: Source(signal="", topic=topic, type=kind or None, decode=None, carries=False)
            for topic, kind in self.found.items()
            if topic not in used
        }


class Delivers(Protocol):
    """What is known of the delivery of topics."""

    @property
    def unpublished(self) -> Collection[str]:
        """Topics without a publisher."""

    @property
    def delivered(self) -> Collection[str]:
        """Topics of which anything ever came."""


class SignalMap:
    """Of one car, over all openings of its link."""

    def __init__(self, place: Place | None = None) -> None:
        """`place`: as of `Evidence`."""
        self.sources: Mapping[str, Source] = {}  # by signal
        self.compared: tuple[Source, ...] = ()  # further topics, decoded to be compared with them
        self.compared_topics: Mapping[str, tuple[str, ...]] = {}  # the same by signal
        self.carriers: Mapping[str, str] = {}  # signal → the topic that carries it
        self.unmapped: Mapping[str, str] = {}  # topic → type of what carries no signal
        self.offers_nothing = False  # no topic of the car can be read
        self.undecided: Mapping[str, str] = {}  # signal → why none of its topics carries it
        self.questions: Sequence[Question] = ()
        self.watched: Mapping[str, Source] = {}  # topic → what it may carry, of signals that none carries yet
        self.by_name: TopicsByName | None = None  # of a bridge that does not name its topics
        self.new_by_name: tuple[str, ...] = ()  # of those, what the first choice among them uses
        self._picked: Mapping[str, str] = {}
        self._evidence = Evidence(place)
        self._choice: Choice | None = None
        self._compared_since_s: float | None = None

    def update(
        self,
        offered: Mapping[str, str],
        picked: Mapping[str, str],
        delivery: Delivers,
        now_s: float = 0.0,
    ) -> None:
        """Chooses the topic of each signal. `offered`: topic → type; `picked`: signal → topic, by an operator;
        `now_s` on a monotonic clock."""
        evidence, before, unpublished, delivered = (
            self._evidence, self.sources, delivery.unpublished, delivery.delivered,
        )  # fmt: skip
        follow(evidence, offered, picked)
        in_use = {signal: source.topic for signal, source in before.items() if source.topic in delivered}
        choice = self._choice = choose(offered, picked, unpublished, evidence, in_use)
        self.watched = {one.topic: one for found in choice.watched.values() for one in found}
        if self._settle(now_s):
            choice = self._choice = choose(offered, picked, unpublished, evidence, in_use)
        # A topic that vanished stays subscribed: it may come back, and another is not taken in its place unasked.
        gone = {
            signal: source
            for signal, source in before.items()
            if source.topic not in offered
            and (signal not in choice.sources or (signal in in_use and signal not in picked))
            and picked.get(signal) in (None, source.topic)
        }
        self.sources = {**choice.sources, **gone}
        self.undecided = {signal: why for signal, why in choice.undecided.items() if signal not in gone}
        self.questions = [
            *(_instead(gone[signal], choice.sources[signal]) for signal in gone if signal in choice.sources),
            *choice.questions,
        ]
        self.carriers = pipeline.carriers(self.sources.values())
        was_compared = {source.topic for source in self.compared}
        self.compared = comparison_sources(offered, self.sources, unpublished=unpublished, before=was_compared)
        self.compared_topics = pipeline.compared(self.compared)
        mapped = {source.topic for source in self.sources.values()}
        self.unmapped = {name: kind for name, kind in offered.items() if name not in mapped}
        self.offers_nothing = not self.undecided and not any(source.decode for source in self.sources.values())

    def update_by_name(self, picked: Mapping[str, str], delivery: Delivers, now_s: float) -> Mapping[str, str]:
        """The same of a bridge that does not name its topics: of those of which messages came, topic → type."""
        by_name = self.by_name = self.by_name or TopicsByName()
        self._picked = picked
        was_used, before = by_name.is_used, {one.topic for one in self.decoded}
        offered = by_name.offered(picked, now_s)
        if offered:
            self.update(offered, picked, delivery, now_s)
            self.sources = {signal: replace(one, note=one.note or NOTE) for signal, one in self.sources.items()}
        self.watched = {**by_name.beside({one.topic: one for one in self.decoded}), **self.watched}
        is_first = by_name.is_used and not was_used
        self.new_by_name = (
            tuple({one.topic: None for one in self.decoded if one.topic not in before}) if is_first else ()
        )
        return by_name.found

    def _settle(self, now_s: float) -> bool:
        """Whether only now enough is known of the candidates to prompt the operator."""
        was_settled = self._evidence.is_settled
        if not self.watched:
            self._compared_since_s = None
            self._evidence.is_settled = True
        else:
            if self._compared_since_s is None:
                self._compared_since_s = now_s
            self._evidence.is_settled = self._had_their_time(now_s)
        return self._evidence.is_settled is not was_settled

    def is_due(self, now_s: float) -> bool:
        """Whether candidates had their time, so that `update` may decide otherwise."""
        if self.by_name is not None and self.by_name.is_due(now_s):
            return True
        return not self._evidence.is_settled and self._had_their_time(now_s)

    def _had_their_time(self, now_s: float) -> bool:
        is_seen = all(self._evidence.of(topic).count for topic in self.watched)
        since_s = self._compared_since_s
        return since_s is not None and now_s - since_s >= (SEEN_S if is_seen else SETTLED_S)

    def compare(self, topic: str, message: Any, now_s: float) -> bool:
        """Takes a message of any topic as evidence; whether `update` may decide otherwise by it."""
        is_new = self.by_name is not None and self.by_name.receive(topic, message, self._picked, now_s)
        if self.by_name is not None and topic not in self.watched:
            self.watched = {**self.by_name.beside({one.topic: one for one in self.decoded}), **self.watched}
        return self._evidence.receive(topic, message, now_s) or is_new

    def candidates(self, offered: Mapping[str, str] | None) -> dict[str, list[TopicOffer]] | None:
        """Signal → the topics that can carry it, with what is known of each; None: not known."""
        if offered is None:
            if self.by_name is None:
                return None
            offered = self.by_name.found
        return offers(offered, {} if self._choice is None else self._choice.reasons, self._evidence)

    @property
    def decoded(self) -> tuple[Source, ...]:
        """What carries the signals, and what is compared with it."""
        return (*self.sources.values(), *self.compared)

    @property
    def command_topic(self) -> str | None:
        """Where others command the car."""
        source = self.sources.get(COMMAND)
        return source.topic if source is not None else None


def _instead(gone: Source, other: Source) -> Question:
    """A topic that carried a signal vanished, and another could carry it."""
    return {
        "signal": gone.signal,
        "kind": "source",
        "words": f"{SIGNALS[gone.signal].label}: {gone.topic} is gone. Is it {other.topic} now?",
        "options": [
            {"value": other.topic, "label": other.topic, "why": other.why or ""},
            {"value": gone.topic, "label": gone.topic, "why": "it is waited for"},
        ],
        "options_count": 2,
    }
