"""Chooses the topic of each signal by evidence, with a reason; what evidence does not decide becomes a question. Pure.

In this order: the operator's pick; a type that can be read; a publisher; the namespace of one car; what the messages
show; a usual name; the only topic of its type.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from server.judge.frame_names import is_earth_fixed
from server.judge.signals import TOPICS
from server.judge.signals.odometry import pose_only
from server.judge.signals.speed import way_made, way_made_stamped
from server.judge.sources import candidates
from server.judge.sources.candidates import (
    MOST_COMPARED,
    OTHER_CAR,
    OWN_NAMES,
    USUAL_NAME,
    Candidate,
    Pools,
    cars_of,
    named_first,
    pools_of,
    what_is_known,
)
from server.judge.sources.evidence import Evidence
from server.judge.sources.namespaces import is_within, namespace_of
from server.judge.sources.source import BY_SIGNAL, COMMAND, Source, plain_type, unread
from server.judge.topic import FLOATS
from server.protocol.questions import Question

PICKED = "chosen by the operator"
BY_NAME = "its name"
ONLY_ONE = "the only one of its type"
EAST_AND_NORTH = "its velocity is east and north: the way made, without a sign"
MOST_WATCHED = 4  # candidates of one signal


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which topic carries each signal of a car, and what is not decided. All by signal."""

    sources: Mapping[str, Source]
    undecided: Mapping[str, str]  # a short reason why no topic is taken though there are some
    refused: frozenset[str] = frozenset()  # those of them where there is nothing to choose from
    reasons: Mapping[str, Mapping[str, str]]  # topic → what is known of it
    questions: Sequence[Question] = ()
    watched: Mapping[str, tuple[Source, ...]]  # further candidates whose messages may decide, refused ones too

    @property
    def competing(self) -> frozenset[str]:
        """The topics of signals that none carries yet."""
        return frozenset(topic for signal in self.undecided for topic in self.reasons[signal])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Open:
    """No topic is taken. `among`: the options of the question; empty: no question. `watch`: those that may yet
    be filled."""

    why: str
    among: Sequence[Candidate] = ()
    watch: Sequence[Candidate] = ()


def choose(
    offered: Mapping[str, str],
    picked: Mapping[str, str] | None = None,
    unpublished: Collection[str] = (),
    evidence: Evidence | None = None,
    in_use: Mapping[str, str] | None = None,
) -> Choice:
    """The choice for a car's topics (topic → type). `picked`: signal → topic, by the operator; `unpublished`: topics
    that no node publishes; `in_use`: signal → topic that carries it now and works.

    An unpublished topic is not read; it stands for its signal, with a note, only where the operator picked it or
    nothing else could carry the signal. The command topic is kept by its name: the car listens there, and others may
    not have begun to publish.
    """
    return _Chooser(offered, picked or {}, unpublished, evidence or Evidence(), in_use or {}).choice()


class _Chooser:
    """One choice."""

    def __init__(
        self,
        offered: Mapping[str, str],
        picked: Mapping[str, str],
        unpublished: Collection[str],
        evidence: Evidence,
        in_use: Mapping[str, str],
    ) -> None:
        self._offered, self._picked, self._unpublished = offered, picked, unpublished
        self._evidence, self._in_use = evidence, in_use
        self._pools: Pools = pools_of(offered, unpublished)
        self._cars = cars_of(self._pools)
        self._car = self._only_car(picked.values())
        self._is_car_assumed = self._car is None and not any(namespace_of(t, self._cars) for t in picked.values())
        if self._is_car_assumed:
            self._car = self._only_car(in_use.values())  # another car appeared: this one stays until the answer

    def _only_car(self, topics: Collection[str]) -> str | None:
        found = {car for topic in topics if (car := namespace_of(topic, self._cars)) is not None}
        return found.pop() if len(found) == 1 else None

    def choice(self) -> Choice:
        found = {row.signal: self._decide(row.signal) for row in TOPICS}
        self._follow_speed(found)
        sources = {signal: one for signal, one in found.items() if isinstance(one, Source)}
        opened = {signal: one for signal, one in found.items() if isinstance(one, _Open)}
        return Choice(
            sources=sources,
            undecided={signal: one.why for signal, one in opened.items()},
            refused=frozenset(signal for signal, one in opened.items() if not one.among),
            reasons=self._reasons(sources),
            questions=self._questions(opened) if self._evidence.is_settled else (),
            watched={
                signal: tuple(
                    replace(candidate.source(signal, why="compared"), carries=False)
                    for candidate in one.among[:MOST_WATCHED] or one.watch[:MOST_COMPARED]
                    if candidate.is_published
                )
                for signal, one in opened.items()
                if signal in ("speed", "odometry", "position", "scan")
            }
            | self._other_numbers(sources.get("speed")),
        )

    def _other_numbers(self, source: Source | None) -> dict[str, tuple[Source, ...]]:
        """Plain numbers that may be the speed, as long as the one in use is zero: nothing else compares them."""
        if source is None or source.decode is None or self._evidence.of(source.topic).has_twist:
            return {}
        found = tuple(
            replace(one.source("speed", why="compared"), carries=False)
            for one in self._pools["speed"]
            if one.plain_type in FLOATS and one.is_readable and one.is_published and one.topic != source.topic
        )
        return {"speed": found[:MOST_WATCHED]} if found else {}

    def _decide(self, signal: str) -> Source | _Open | None:
        pick = self._picked.get(signal)
        if pick:
            return self._of_pick(signal, pick)
        pool = self._pools[signal]
        if signal == COMMAND:
            found = named_first([one for one in pool if one.is_readable]) or named_first(pool)
            return None if found is None else self._read(found.source(signal, why=BY_NAME))
        if self._cars:
            inside = [one for one in pool if namespace_of(one.topic, self._cars) is not None]
            if inside and self._car is None:
                return _Open(why=f"{_lower(candidates.counted(len(self._cars), 'cars'))}, none chosen", among=inside)
            own = [one for one in inside if self._car is not None and is_within(one.topic, self._car)]
            pool = own or [one for one in pool if one not in inside]
        readable = [one for one in pool if one.is_readable]
        if not readable:
            return None if not pool else self._read(pool[0].source(signal, why=BY_NAME))
        return self._among(signal, [one for one in readable if one.is_published] or readable)

    def _among(self, signal: str, found: list[Candidate]) -> Source | _Open:
        """Of candidates of one car that can be read."""
        if not found[0].is_published:
            why = BY_NAME if found[0].is_named else NO_OTHER
            return unread(found[0].source(signal, why=why))
        if signal == "scan":
            return self._laser(found)
        found = [one for one in found if one.topic not in self._evidence.silent] or found
        if signal == "speed":
            return self._speed(found)
        result = self._plain(signal, found)
        if isinstance(result, Source) and signal == "odometry" and self._evidence.of(result.topic).is_empty_by_odometry:
            return replace(result, decode=pose_only, note="its twist is never filled: it gives no speed")
        return result

    def _plain(self, signal: str, found: list[Candidate]) -> Source | _Open:
        """By a usual name, else the only one, else one that agrees with all others."""
        named = named_first(found)
        if named is not None:
            return named.source(signal, why=BY_NAME)
        if len(found) == 1:
            return found[0].source(signal, why=ONLY_ONE)
        if all(self._evidence.agree(found[0].topic, other.topic) for other in found[1:]):
            return found[0].source(signal, why="its values agree with those of the others")
        kept = next((one for one in found if one.topic == self._in_use.get(signal)), None)
        if kept is not None:
            return kept.source(signal, why="in use since before the others came")
        return _Open(why=f"{_lower(candidates.title(signal, found))}, none chosen", among=found)

    def _speed(self, found: list[Candidate]) -> Source | _Open:
        """Take what is zero while the car moves only if just a receiver shows the motion and there is no other."""
        filled = [one for one in found if not self._evidence.of(one.topic).is_twist_empty]
        undoubted = [one for one in found if not self._evidence.of(one.topic).is_empty_by_odometry]
        among = self._speed_among(filled, found) or self._speed_among(undoubted, found)
        return among or _Open(why=_empty([one.topic for one in found], self._evidence), watch=found)

    def _speed_among(self, filled: list[Candidate], found: list[Candidate]) -> Source | _Open | None:
        own = next((one for one in filled if one.topic.lower() == OWN_NAMES["speed"]), None)
        if own is not None:
            return own.source("speed", why=BY_NAME)
        named = [one for one in filled if one.is_named]
        along = [one for one in named if not self._is_earth_fixed(one)]
        if along and (first := named_first(along)) is not None:
            return first.source("speed", why=BY_NAME)
        odometries = [one for one in filled if one not in named]
        if odometries:
            return self._speed_of_odometry(odometries, has_others=len(odometries) < len(found))
        earth = [one for one in named if self._is_earth_fixed(one)]
        if earth and (first := named_first(earth)) is not None:
            return _as_way_made(first.source("speed", why="the only speed there is"))
        return None

    def _speed_of_odometry(self, found: list[Candidate], *, has_others: bool) -> Source | _Open:
        usual = [name.lower() for name in BY_SIGNAL["odometry"].names]
        named = sorted((usual.index(one.topic.lower()), one.topic) for one in found if one.topic.lower() in usual)
        if named and len(found) > 1:
            first = next(one for one in found if one.topic == named[0][1])
            return first.source("speed", why=BY_NAME)
        result = self._plain("speed", found)
        if isinstance(result, Source) and len(found) == 1 and has_others:
            return replace(result, why="the only speed along the car")
        return result

    def _is_earth_fixed(self, one: Candidate) -> bool:
        known = self._evidence.of(one.topic)
        if one.plain_type not in ("geometry_msgs/TwistStamped", "geometry_msgs/Twist"):
            return False
        return known.is_earth_fixed or (known.frame is not None and is_earth_fixed(known.frame))

    def _laser(self, found: list[Candidate]) -> Source | _Open:
        own = next((one for one in found if one.topic.lower() == OWN_NAMES["scan"]), None)
        if own is not None:
            return own.source("scan", why="its name: the laser at the front")
        if len(found) == 1:
            return found[0].source("scan", why=BY_NAME if found[0].is_named else ONLY_ONE)
        evidence = self._evidence
        ahead = [one for one in found if evidence.of(one.topic).looks_ahead]
        if len(ahead) == 1:
            return ahead[0].source("scan", why="faces forward by TF")
        first = named_first(ahead or found) or min(ahead or found, key=lambda one: (len(one.topic), one.topic))
        if all(one is first or evidence.agree(first.topic, one.topic) for one in ahead or found):
            return first.source("scan", why="faces forward by TF" if ahead else "one laser, of which others are copies")
        order = sorted(found, key=lambda one: one not in ahead)
        used = next((one for one in found if one.topic == self._in_use.get("scan")), None)
        if used is not None and all(evidence.of(one.topic).looks_ahead is None for one in found):
            return used.source("scan", why="in use; no evidence against it")
        if not evidence.is_settled:
            return _Open(why="lasers are being compared", among=order)
        return _Open(why=f"{_lower(candidates.title('scan', found))}, none chosen", among=order)

    def _of_pick(self, signal: str, topic: str) -> Source | _Open:
        kind = self._offered.get(topic)
        if kind is None:
            return _Open(why=f"{topic}, chosen by the operator, is not there")
        is_by_type = plain_type(kind) in BY_SIGNAL[signal].by_type
        one = Candidate(
            topic=topic,
            type=kind,
            rank=None if is_by_type else 0,
            is_readable=plain_type(kind) in BY_SIGNAL[signal].types,
            is_published=topic not in self._unpublished,
        )
        if signal == "speed" and self._evidence.of(topic).is_empty_by_odometry:
            return _Open(why=_empty([topic], self._evidence), watch=(one,))
        source = one.source(signal, why=PICKED)
        if signal == "speed" and self._is_earth_fixed(one):
            source = _as_way_made(source)
        if signal == "odometry" and source.decode is not None and self._evidence.of(topic).is_empty_by_odometry:
            source = replace(source, decode=pose_only, note="its twist is never filled: it gives no speed")
        return self._read(source)

    def _read(self, source: Source) -> Source:
        return unread(source) if source.topic in self._unpublished else source

    def _follow_speed(self, found: dict[str, Source | _Open | None]) -> None:
        """The odometry that the operator picked for one of speed and odometry carries the other one too."""
        for signal, other in (("odometry", "speed"), ("speed", "odometry")):
            opened, source = found[signal], found[other]
            if isinstance(opened, _Open) and isinstance(source, Source) and self._picked.get(other) == source.topic:
                if any(one.topic == source.topic for one in opened.among):
                    if signal == "odometry" or not self._evidence.of(source.topic).is_twist_empty:
                        one = next(one for one in opened.among if one.topic == source.topic)
                        found[signal] = self._read(one.source(signal, why=f"{PICKED} for {other}"))

    def _questions(self, opened: Mapping[str, _Open]) -> tuple[Question, ...]:
        questions: list[Question] = []
        covered: set[str] = set()  # topics of the questions so far
        if self._cars and self._is_car_assumed:
            return (self._question_of_cars(),)
        for signal in sorted(opened, key=lambda name: candidates.ORDER.index(name) if name in candidates.ORDER else 99):
            among = opened[signal].among
            if not among:
                continue
            if signal == "odometry" and {one.topic for one in among} <= covered:
                continue  # the answer for the speed answers this too
            covered |= {one.topic for one in among}
            questions.append(candidates.question(signal, among, self._known(signal, among)))
        return tuple(questions)

    def _question_of_cars(self) -> Question:
        """The question for the source of one signal; the namespace of the answer decides for the others."""
        by_signal = {
            signal: [one for one in pool if one.is_readable and namespace_of(one.topic, self._cars)]
            for signal, pool in self._pools.items()
            if signal not in self._picked
        }
        signal = max(by_signal, key=lambda name: len({namespace_of(o.topic, self._cars) for o in by_signal[name]}))
        among = by_signal[signal]
        return candidates.question(signal, among, self._known(signal, among), self._cars)

    def _known(self, signal: str, among: Sequence[Candidate]) -> dict[str, str]:
        return {one.topic: what_is_known(one, signal, self._evidence) for one in among[: candidates.MOST_OPTIONS]}

    def _reasons(self, sources: Mapping[str, Source]) -> dict[str, dict[str, str]]:
        """The reasons for and against each candidate."""
        found: dict[str, dict[str, str]] = {}
        for signal, pool in self._pools.items():
            rows = found[signal] = {}
            for one in pool:
                known = what_is_known(one, signal, self._evidence)
                car = namespace_of(one.topic, self._cars)
                if car is not None and car != self._car:
                    known = f"{OTHER_CAR}: {car}" if self._car else f"of the car {car}"
                source = sources.get(signal)
                if source is not None and source.topic == one.topic and source.why:
                    rest = [fact for fact in known.split(", ") if fact != USUAL_NAME or source.why != BY_NAME]
                    known = ", ".join(dict.fromkeys([source.why, *rest])).rstrip(", ")
                rows[one.topic] = known
        return found


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


NO_OTHER = "nothing else could carry it"


def _as_way_made(source: Source) -> Source:
    is_stamped = (source.type or "").endswith("TwistStamped")
    return replace(source, decode=way_made_stamped if is_stamped else way_made, note=EAST_AND_NORTH)


def _empty(topics: Sequence[str], evidence: Evidence) -> str:
    if len(topics) == 1:
        return f"{topics[0]} has no speed: {evidence.of(topics[0]).why_empty}"
    return f"{', '.join(topics[:3])} have no speed: they are zero while the car moves"
