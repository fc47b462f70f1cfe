"""Which topics of a car can carry each signal, and which are watched to compare them with the source of one. Pure."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from monitor.values import Odometry, Twist
from server.judge.message_fields import NotMeasured, finite, inner, number
from server.judge.signals.odometry import odometry
from server.judge.signals.position import nav_sat_fix
from server.judge.sources.candidates import cars_of, pools_of
from server.judge.sources.evidence import Evidence
from server.judge.sources.motion import is_lost
from server.judge.sources.namespaces import is_of_another_robot, namespace_of
from server.judge.topic import Decode
from server.judge.topics import BY_SIGNAL, Source, candidates, plain_type
from server.judge.units import FASTEST_KMH, plausible_speed
from server.protocol.questions import TopicOffer

Reasons = Mapping[str, Mapping[str, str]]  # signal → topic → reasons for and against it

MOST = 4  # further topics of one signal
FIX, ODOMETRY = "sensor_msgs/NavSatFix", "nav_msgs/Odometry"
TWISTS = ("geometry_msgs/Twist", "geometry_msgs/TwistStamped")
VELOCITY_OF_A_RECEIVER = "vel"  # beside its NavSatFix, as the drivers of receivers name it


def offers(offered: Mapping[str, str], reasons: Reasons, evidence: Evidence) -> dict[str, list[TopicOffer]]:
    """Signal → its candidates among the topics of a car (topic → type)."""
    found = candidates(offered)
    for signal, rows in found.items():
        for row in rows:
            known, why = evidence.of(row["topic"]), reasons.get(signal, {}).get(row["topic"])
            if why:
                row["why"] = why
            if known.count:
                row["frame"] = known.frame
            if signal == "scan" and known.picture is not None:
                row["ranges_m"] = list(known.picture.ranges_m)
                row["angle_min_rad"] = known.picture.angle_min_rad
                row["angle_increment_rad"] = known.picture.angle_increment_rad
    return found


def size_of_twist(message: Any) -> Twist:
    """The size of a horizontal velocity in the unit of its topic, the same in the frame of the body and in east and
    north; its turning is not known."""
    vector = message if "linear" in message else inner(message, "twist")
    x, y = finite(vector, "linear", "x"), number(vector, "linear", "y")
    return Twist(speed_mps=plausible_speed(math.hypot(x, 0.0 if math.isnan(y) else y), FASTEST_KMH))


def odometry_that_is_not_lost(message: Any) -> Odometry:
    """Raises NotMeasured where the covariance marks the pose as unknown."""
    if is_lost(inner(message, "pose")):
        raise NotMeasured("lost")
    return odometry(message)


def comparison_sources(
    found: Mapping[str, str],
    sources: Mapping[str, Source],
    *,
    unpublished: Collection[str] = (),
    before: Collection[str] = (),
) -> tuple[Source, ...]:
    """Further topics of position, odometry and speed, at most four of each, none of which carries its signal.

    `found`: topic → type of all topics; `sources`: what carries each signal; `unpublished`: topics without a publisher;
    `before`: topics that were compared until now, which come first.
    """
    usable = {topic: plain_type(kind) for topic, kind in found.items() if topic not in unpublished}
    cars = cars_of(pools_of(found, unpublished))
    result: list[Source] = []
    for signal, decode, is_fit in _kinds(usable):
        carrier = sources.get(signal)
        if carrier is None or carrier.decode is None:
            continue
        taken = {carrier.topic, _topic(sources, "command")}
        if signal != "odometry":  # the poses of an odometry are another source than its twist
            taken.add(_topic(sources, "speed"))
        topics = [
            topic
            for topic, kind in usable.items()
            if topic not in taken
            and is_fit(topic, kind)
            and namespace_of(topic, cars) in (None, namespace_of(carrier.topic, cars))
            and not is_of_another_robot(topic, carrier.topic, usable)
        ]
        own = _folder(carrier.topic)
        order = sorted((topic not in before, _folder(topic) != own, topic) for topic in topics)
        result += [
            Source(signal=signal, topic=topic, type=found[topic], decode=decode, why="to compare", carries=False)
            for _, _, topic in order[:MOST]
        ]
    return tuple(result)


def _kinds(usable: Mapping[str, str]) -> Iterator[tuple[str, Decode, Any]]:
    """Signal, decoder, and which topics show it: a plain number has no unit, and a Twist may be a command."""
    receivers = {_folder(topic) for topic, kind in usable.items() if kind == FIX}
    names = {name.lower() for name in BY_SIGNAL["speed"].names}
    yield "position", nav_sat_fix, lambda topic, kind: kind == FIX
    yield "odometry", odometry_that_is_not_lost, lambda topic, kind: kind == ODOMETRY
    yield (
        "speed",
        size_of_twist,
        lambda topic, kind: (
            kind in TWISTS
            and (
                topic.lower() in names
                or (_folder(topic) in receivers and topic.rpartition("/")[2] == VELOCITY_OF_A_RECEIVER)
            )
        ),
    )


def _topic(sources: Mapping[str, Source], signal: str) -> str | None:
    source = sources.get(signal)
    return None if source is None else source.topic


def _folder(topic: str) -> str:
    return topic.rpartition("/")[0]
