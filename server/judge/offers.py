"""The topics of a car that can carry each signal, with what is known of each, for the page."""

from __future__ import annotations

from collections.abc import Mapping

from server.judge.sources.evidence import Evidence
from server.judge.topics import candidates
from server.protocol.topic_offer import TopicOffer

Reasons = Mapping[str, Mapping[str, str]]  # signal → topic → what speaks for it and against it


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
