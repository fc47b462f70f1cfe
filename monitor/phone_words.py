"""Why a phone has no usable position, in words that the operator reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

from monitor.phones import WORST_ACCURACY_M, PhoneView, Why


@dataclass(frozen=True, slots=True, kw_only=True)
class WhyWords:
    """One reason: what is wrong (no full stop), and two short names for tiles: at most 8 and 14 letters."""

    sentence: str
    short: str
    brief: str


def why_words(why: Why, view: PhoneView, now_s: float) -> WhyWords:
    match why:
        case "denied":
            return WhyWords(sentence="The phone was not allowed to tell it", short="denied", brief="permission")
        case "insecure":
            return WhyWords(
                sentence="The page was not opened over HTTPS, and phones give it to no other",
                short="HTTPS",
                brief="needs HTTPS",
            )
        case "unavailable":
            return WhyWords(sentence="The phone finds no position", short="no fix", brief="no fix")
        case "timeout":
            return WhyWords(sentence="The phone has been waiting for a fix", short="no fix", brief="no fix")
        case "hidden":
            return WhyWords(
                sentence="The page is in the background, where phones give no position",
                short="hidden",
                brief="background",
            )
        case "off":
            return WhyWords(sentence="The phone has left", short="left", brief="left")
        case "coarse":
            radius_m = view.fix.accuracy_m if view.fix is not None else 0.0
            return WhyWords(
                sentence=f"The phone knows it to {radius_m:.0f} m only, {WORST_ACCURACY_M:.0f} m are needed",
                short="coarse",
                brief=f"±{radius_m:.0f} m",
            )
        case "old":
            return WhyWords(
                sentence=f"The phone's newest fix is {now_s - view.measured_s:.0f} s old", short="old", brief="old"
            )
        case "late":
            return WhyWords(
                sentence="The phone's messages come too late over the radio", short="late", brief="comes late"
            )
        case "silent":
            return WhyWords(
                sentence=f"The phone has not been heard for {now_s - view.heard_s:.0f} s",
                short="silent",
                brief="silent",
            )
        case _:
            assert_never(why)
