"""Why a phone has no usable position, as text for the operator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

from monitor.phones import WORST_ACCURACY_M, PhoneView, Why


@dataclass(frozen=True, slots=True, kw_only=True)
class WhyText:
    """One reason: what is wrong (no full stop), and two short names for tiles: at most 8 and 14 letters."""

    sentence: str
    short: str
    brief: str


def name_of(view: PhoneView) -> str:
    """The phone as an alarm names it: every operator reads that, so "this phone" would be wrong."""
    return f"the phone ({view.label or 'one'}, of {view.count} phones)" if view.count > 1 else "the phone"


def why_text(why: Why, view: PhoneView, now_s: float, phone: str = "this phone") -> WhyText:
    """The reason as text. `phone` names the phone within the sentence: "this phone" beside the phone's own row."""
    match why:
        case "denied":
            return WhyText(sentence=f"Location permission denied on {phone}", short="denied", brief="permission")
        case "insecure":
            return WhyText(
                sentence=f"The page on {phone} was not opened over HTTPS, which a position needs",
                short="HTTPS",
                brief="needs HTTPS",
            )
        case "unavailable":
            return WhyText(sentence=f"No position found by {phone}", short="no fix", brief="no fix")
        case "timeout":
            return WhyText(
                sentence=f"No GPS fix on {phone} for {view.missing_s(now_s):.0f} s", short="no fix", brief="no fix"
            )
        case "hidden":
            return WhyText(
                sentence=f"The page on {phone} is in the background, where it gets no position",
                short="hidden",
                brief="background",
            )
        case "off":
            return WhyText(sentence=f"The page on {phone} was closed", short="left", brief="left")
        case "coarse":
            radius_m = view.fix.accuracy_m if view.fix is not None else 0.0
            return WhyText(
                sentence=f"Position of {phone} is accurate to {radius_m:.0f} m only; "
                f"{WORST_ACCURACY_M:.0f} m is needed",
                short="coarse",
                brief=f"±{radius_m:.0f} m",
            )
        case "old":
            return WhyText(
                sentence=f"The newest fix of {phone} is {now_s - view.measured_s:.0f} s old", short="old", brief="old"
            )
        case "late":
            return WhyText(
                sentence=f"Positions of {phone} arrive too late over the radio", short="late", brief="comes late"
            )
        case "silent":
            return WhyText(
                sentence=f"No position from {phone} for {now_s - view.received_s:.0f} s",
                short="silent",
                brief="silent",
            )
        case _:
            assert_never(why)
