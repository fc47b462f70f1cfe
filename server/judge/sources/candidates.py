"""The topics of a car that may carry each signal, by their names and types, and which of them need to be compared."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from server.judge.frame_names import direction_by_name
from server.judge.signals import TOPICS
from server.judge.sources import namespaces
from server.judge.sources.evidence import Evidence
from server.judge.sources.source import BY_SIGNAL, Source, plain_type, source_of
from server.judge.topic import Topic
from server.protocol.questions import Question

MOST_COMPARED = 12  # topics of one signal
MOST_BESIDE = 4  # of those that show whether the car moves
OWN_NAMES = {"speed": "/catvehicle/vel", "scan": "/catvehicle/front_laser_points"}  # names that say enough
OTHER_CAR = "of another car"
USUAL_NAME = "a usual name"
NO_PUBLISHER = "no node publishes it"

MOST_OPTIONS = 12
ORDER = ("scan", "speed", "position", "odometry")  # the most urgent first
_NUMBERS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
_KINDS = {
    "scan": ("lasers", "which one faces forward?"),
    "speed": ("sources of speed", "which is the car's?"),
    "odometry": ("odometries", "which is the car's?"),
    "position": ("GPS receivers", "which is the car's?"),
    "mode": ("reports of the driving mode", "which is the car's?"),
    "diagnostics": ("topics of diagnostics", "which is the car's?"),
}
_OTHER = ("topics", "which is the car's?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A topic that may carry a signal."""

    topic: str
    type: str
    rank: int | None  # of its name among those of the signal; None: found by its type alone
    is_readable: bool
    is_published: bool

    @property
    def is_named(self) -> bool:
        return self.rank is not None

    @property
    def plain_type(self) -> str:
        """Its type in the spelling of ROS 1."""
        return plain_type(self.type)

    def source(self, signal: str, *, why: str) -> Source:
        """It as the source of a signal."""
        return source_of(BY_SIGNAL[signal], self.topic, self.type, why=why, is_by_type=self.rank is None)


Pools = Mapping[str, list[Candidate]]


def pools_of(offered: Mapping[str, str], unpublished: Collection[str] = ()) -> Pools:
    """Signal → its candidates (offered: topic → type), the likeliest first: readable, published, by name."""
    by_lower: dict[str, list[str]] = {}
    by_kind: dict[str, list[str]] = {}
    for topic, kind in offered.items():
        by_lower.setdefault(topic.lower(), []).append(topic)
        by_kind.setdefault(plain_type(kind), []).append(topic)
    return {row.signal: _pool(row, offered, by_lower, by_kind, unpublished) for row in TOPICS}


def _pool(
    row: Topic,
    offered: Mapping[str, str],
    by_lower: Mapping[str, list[str]],
    by_kind: Mapping[str, list[str]],
    unpublished: Collection[str],
) -> list[Candidate]:
    ranks: dict[str, int | None] = {}
    for rank, name in enumerate(row.names):
        for topic in sorted(by_lower.get(name.lower(), ())):
            ranks.setdefault(topic, rank)
    for kind in row.by_type:
        for topic in by_kind.get(kind, ()):
            ranks.setdefault(topic, None)
    found = [
        Candidate(
            topic=topic,
            type=offered[topic],
            rank=rank,
            is_readable=plain_type(offered[topic]) in row.types,
            is_published=topic not in unpublished,
        )
        for topic, rank in ranks.items()
    ]
    return sorted(found, key=_likeliest)


def _likeliest(one: Candidate) -> tuple[bool, bool, bool, int, int, str]:
    rank = 0 if one.rank is None else one.rank
    return (not one.is_readable, not one.is_published, one.rank is None, direction_by_name(one.topic), rank, one.topic)


def to_compare(offered: Mapping[str, str], picked: Mapping[str, str]) -> dict[str, str]:
    """The topics (topic → type) whose messages may decide which of them carries a signal; empty: names and types do."""
    pools = pools_of(offered)
    wanted: dict[str, str] = {}

    def add(found: Collection[Candidate]) -> None:
        wanted.update({one.topic: one.type for one in [c for c in found if c.is_readable][:MOST_COMPARED]})

    for signal in ("scan", "odometry", "position"):
        readable = [one for one in pools[signal] if one.is_readable]
        is_clear = signal != "scan" and any(one.is_named for one in readable)
        if len(readable) > 1 and signal not in picked and not is_clear and not _has_own_name(signal, readable):
            add(readable)
    speeds = [one for one in pools["speed"] if one.is_readable]
    pick = picked.get("speed")
    if pick is not None:
        speeds = [one for one in speeds if one.topic == pick]
    if pick is not None or not _has_own_name("speed", speeds):
        add(speeds)
    return wanted


def beside_the_speed(offered: Mapping[str, str]) -> dict[str, str]:
    """The topics (topic → type) that show whether the car moves, and whether the twists of those are filled."""
    pools, wanted = pools_of(offered), dict[str, str]()
    own = [one for one in pools["speed"] if one.is_readable and one.topic.lower() == OWN_NAMES["speed"]]
    for found in (own, pools["odometry"], pools["position"]):
        wanted.update({one.topic: one.type for one in [c for c in found if c.is_readable][:MOST_BESIDE]})
    return wanted


def follow(evidence: Evidence, offered: Mapping[str, str], picked: Mapping[str, str]) -> None:
    """Lets the messages of all topics that may decide count."""
    evidence.follow(to_compare(offered, picked))
    evidence.follow(beside_the_speed(offered), is_beside=True)
    evidence.is_of_one_car = OneCar(offered)


class OneCar:
    """Whether two topics are of one car, as far as their names and types say."""

    def __init__(self, offered: Mapping[str, str]) -> None:
        self._offered = offered
        self._cars: tuple[str, ...] | None = None
        self._known: dict[tuple[str, str], bool] = {}

    def __call__(self, one: str, other: str) -> bool:
        found = self._known.get((one, other))
        if found is None:
            if self._cars is None:
                self._cars = cars_of(pools_of(self._offered))
                self._usable = {topic: plain_type(kind) for topic, kind in self._offered.items()}
            found = self._known[one, other] = namespaces.namespace_of(one, self._cars) == namespaces.namespace_of(
                other, self._cars
            ) and not namespaces.is_of_another_robot(one, other, self._usable)
        return found


def _has_own_name(signal: str, found: Collection[Candidate]) -> bool:
    return any(one.topic.lower() == OWN_NAMES[signal] for one in found) if signal in OWN_NAMES else False


def cars_of(pools: Pools) -> tuple[str, ...]:
    """The namespaces of several cars on one bridge; empty: there is one car."""
    return namespaces.competing({signal: [one.topic for one in pool] for signal, pool in pools.items()})


def named_first(found: Collection[Candidate]) -> Candidate | None:
    """The candidate of the best name; None: none has a name of the signal."""
    named = [one for one in found if one.rank is not None]
    return min(named, key=lambda one: (one.rank or 0, one.topic)) if named else None


def what_is_known(one: Candidate, signal: str, evidence: Evidence) -> str:
    """The reasons for and against a candidate, as a short list."""
    known, facts = evidence.of(one.topic), list[str]()
    if not one.is_readable:
        facts.append("of a type that cannot be read")
    if not one.is_published:
        facts.append(NO_PUBLISHER)
    if one.topic in evidence.silent:
        facts.append("no message")
    if signal == "scan":
        ahead = known.looks_ahead
        if ahead is not None:
            facts.append("faces forward by TF" if ahead else "faces another direction by TF")
        elif direction_by_name(f"{one.topic} {known.frame or ''}"):
            facts.append(
                "its name suggests forward"
                if direction_by_name(f"{one.topic} {known.frame or ''}") < 0
                else "its name suggests another direction"
            )
    if signal in ("speed", "odometry") and known.is_twist_empty:
        facts.append(known.why_empty)
    if signal == "speed" and known.is_earth_fixed:
        facts.append("its velocity is east and north")
    if one.is_named:
        facts.append(USUAL_NAME)
    if known.frame:
        facts.append(f"frame {known.frame}")
    return ", ".join(facts)


def counted(count: int, what: str) -> str:
    """ "Two lasers", "12 lasers"."""
    return f"{_NUMBERS[count] if count < len(_NUMBERS) else count} {what}"


def title(signal: str, among: Sequence[Candidate]) -> str:
    """What there are several of: "Two lasers"."""
    is_odometry = signal == "speed" and all(one.plain_type == "nav_msgs/Odometry" for one in among)
    return counted(len(among), "odometries" if is_odometry else _KINDS.get(signal, _OTHER)[0])


def question(signal: str, among: Sequence[Candidate], known: Mapping[str, str], cars: Sequence[str] = ()) -> Question:
    """The question which of the candidates carries a signal. `known`: topic → what is known of it; `cars`: the
    namespaces of several cars, one of which is to be chosen."""
    if cars:
        last = f"{len(cars) - 3} more" if len(cars) > 4 else cars[-1]
        named = f"{', '.join(cars[: 3 if len(cars) > 4 else len(cars) - 1])} and {last}"
        text = f"{counted(len(cars), 'cars')}: {named}: which is this?"
    elif signal == "speed" and title(signal, among).endswith("odometries"):
        text = f"{title(signal, among)}: which is the car's speed?"
    else:
        text = f"{title(signal, among)}: {_KINDS.get(signal, _OTHER)[1]}"
    return {
        "signal": signal,
        "kind": "source",
        "words": text,
        "options": [
            {"value": one.topic, "label": one.topic, "why": known.get(one.topic, "")} for one in among[:MOST_OPTIONS]
        ],
        "options_count": len(among),
    }
