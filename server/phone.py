"""The operator's phone between the page and the judge: its word on the server's clock, and its part of the state."""

from __future__ import annotations

import math
from typing import Any

from monitor.agreement import phone_sigma_m
from monitor.phone_words import why_words
from monitor.phones import PhoneView, PhoneWord
from monitor.state import Snapshot
from monitor.values import PhoneFix
from server import commands, wire

MOST_SHOWN = 12
AHEAD_S = 0.25  # by so much the server's time of day may be set back between two frames; more, and nothing is known


def word(command: commands.Position, now_s: float, wall_ms: float, label: str = "") -> PhoneWord:
    """What the phone said, its moment on the clock of `now_s`.

    Three durations, each between two readings of one clock: how old the fix was when the page sent it (the page's), how
    long ago the server told the time that the page echoes (the server's), and how long the page held that (the page's).
    The last two leave the way there and back; the fix was measured within it, so in the middle give or take half.
    """
    fix = command.fix
    if fix is None:
        return PhoneWord(phone=command.phone, is_handheld=command.handheld, label=label, why=command.why)
    way_s = (wall_ms - fix.heard_ms) / 1000 - fix.held_s
    half_s = max(0.0, way_s) / 2 if way_s >= -AHEAD_S else math.inf
    return PhoneWord(
        phone=command.phone,
        is_handheld=command.handheld,
        label=label,
        fix=PhoneFix(
            lat_deg=fix.lat_deg,
            lon_deg=fix.lon_deg,
            accuracy_m=fix.accuracy_m,
            alt_m=fix.alt_m,
            speed_mps=fix.speed_mps,
            heading_deg=fix.heading_deg,
            at_ms=fix.at_ms,
        ),
        measured_s=now_s - fix.age_s - (half_s if math.isfinite(half_s) else 0.0),
        uncertain_s=half_s,
    )


def as_json(view: PhoneView, now_s: float) -> dict[str, Any] | None:
    """The `phone` of a state; None while no phone tells anything."""
    if not view.is_there(now_s):
        return None
    newest = view.comparisons[-1] if view.comparisons else None
    return _place(view, now_s, "the phone") | {
        "count": view.count,
        "choice": _choice(view, now_s),
        "choice_text": _choice_words(view, now_s),
        "apart_m": wire.plain(newest.distance_m, 1) if newest else None,
        "bearing_deg": wire.plain(newest.bearing_deg, 1) if newest else None,
        "compared_age_s": wire.plain(max(0.0, now_s - newest.at_s), 2) if newest else None,
        "explained_m": wire.plain(newest.gate_m, 1) if newest else None,
        "correlation": wire.plain(view.tracks.correlation, 3) if view.tracks else None,
    }


def all_as_json(views: tuple[PhoneView, ...], compared: PhoneView, now_s: float) -> list[dict[str, Any]]:
    """The `phones` of a state: every one that is there; the one that is compared is never left out."""
    there = [view for view in views if view.is_there(now_s)]
    there.sort(key=lambda view: view.phone != compared.phone)
    return [_place(view, now_s) | {"compared": view.phone == compared.phone} for view in there[:MOST_SHOWN]]


def riding_words(snapshot: Snapshot, phone: str | None) -> str:
    """What the log says when a phone was chosen."""
    if phone is None:
        return "No phone is chosen as the one in the car: the first with a usable position is used."
    label = (
        next((view.label for view in snapshot.phones if view.phone == phone), "")
        or "A phone that has not connected yet"
    )
    return f"{label} is in the car: it is compared with the car's position."


def _choice(view: PhoneView, now_s: float) -> str:
    if view.is_chosen:
        return "operator"
    if view.count == 1:
        return "only"
    return "first" if view.why_not(now_s) is None else "none"


def _choice_words(view: PhoneView, now_s: float) -> str:
    match _choice(view, now_s):
        case "operator":
            return "This phone was chosen as the one in the car."
        case "only":
            return "No phone was chosen as the one in the car. The only phone is used."
        case "first":
            return (
                f"No phone was chosen as the one in the car. Of {view.count}, the first with a usable position is used."
            )
    return f"No phone was chosen as the one in the car. None of {view.count} has a usable position."


def _place(view: PhoneView, now_s: float, name: str = "this phone") -> dict[str, Any]:
    """Where one phone is, or why it cannot tell."""
    why, fix = view.why_not(now_s), view.fix
    return {
        "id": view.phone,
        "label": view.label or None,
        "handheld": view.is_handheld,
        "chosen": view.is_chosen,
        "lat_deg": wire.plain(fix.lat_deg, 8) if fix else None,
        "lon_deg": wire.plain(fix.lon_deg, 8) if fix else None,
        "accuracy_m": wire.plain(fix.accuracy_m, 1) if fix else None,
        "sigma_m": wire.plain(phone_sigma_m(fix.accuracy_m), 1) if fix else None,
        "alt_m": wire.plain(fix.alt_m, 1) if fix else None,
        "speed_mps": wire.plain(fix.speed_mps, 2) if fix else None,
        "heading_deg": wire.plain(fix.heading_deg, 1) if fix else None,
        "at_ms": wire.plain(fix.at_ms, 0) if fix else None,
        "age_s": wire.plain(max(0.0, now_s - view.measured_s), 2) if fix else None,
        "used": why is None,
        "why": why,
        "why_text": why_words(why, view, now_s, name).sentence if why else None,
    }
