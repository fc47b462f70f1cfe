"""The operator's phone between the page and the judge: its part of the state."""

from __future__ import annotations

from typing import Literal

from monitor.agreement import phone_sigma_m
from monitor.checks.phone_missing import why_text
from monitor.phones import PhoneView
from monitor.state import Snapshot
from server.protocol import serialize
from server.protocol.operator_state import PhoneCompared, PhoneListed, PhonePlace

MOST_SHOWN = 12


def as_json(view: PhoneView, now_s: float) -> PhoneCompared | None:
    """The `phone` of a state; None while no phone reports."""
    if not view.is_there(now_s):
        return None
    newest = view.comparisons[-1] if view.comparisons else None
    return {
        **_place(view, now_s, "the phone"),
        "count": view.count,
        "choice": _choice(view, now_s),
        "choice_text": _choice_words(view, now_s),
        "apart_m": serialize.plain(newest.distance_m, 1) if newest else None,
        "bearing_deg": serialize.plain(newest.bearing_deg, 1) if newest else None,
        "compared_age_s": serialize.plain(max(0.0, now_s - newest.at_s), 2) if newest else None,
        "explained_m": serialize.plain(newest.gate_m, 1) if newest else None,
        "correlation": serialize.plain(view.tracks.correlation, 3) if view.tracks else None,
    }


def all_as_json(views: tuple[PhoneView, ...], compared: PhoneView, now_s: float) -> list[PhoneListed]:
    """The `phones` of a state: every one that is there; the one that is compared is never left out."""
    there = [view for view in views if view.is_there(now_s)]
    there.sort(key=lambda view: view.phone != compared.phone)
    return [{**_place(view, now_s), "compared": view.phone == compared.phone} for view in there[:MOST_SHOWN]]


def phone_in_car_text(snapshot: Snapshot, phone: str | None) -> str:
    """The log text for the choice of a phone."""
    if phone is None:
        return "No phone is chosen as the phone in the car: the first with a usable position is used."
    label = (
        next((view.label for view in snapshot.phones if view.phone == phone), "")
        or "A phone that has not connected yet"
    )
    return f"{label} is in the car: it is compared with the car's position."


def _choice(view: PhoneView, now_s: float) -> Literal["operator", "only", "first", "none"]:
    if view.is_chosen:
        return "operator"
    if view.count == 1:
        return "only"
    return "first" if view.why_not(now_s) is None else "none"


def _choice_words(view: PhoneView, now_s: float) -> str:
    match _choice(view, now_s):
        case "operator":
            return "This phone was chosen as the phone in the car."
        case "only":
            return "No phone was chosen as the phone in the car. The only phone is used."
        case "first":
            return (
                "No phone was chosen as the phone in the car. "
                f"Of {view.count}, the first with a usable position is used."
            )
    return f"No phone was chosen as the phone in the car. None of {view.count} has a usable position."


def _place(view: PhoneView, now_s: float, name: str = "this phone") -> PhonePlace:
    """The position of one phone, or the reason for none."""
    why, fix = view.why_not(now_s), view.fix
    return {
        "id": view.phone or "",
        "label": view.label or None,
        "handheld": view.is_handheld,
        "chosen": view.is_chosen,
        "lat_deg": serialize.plain(fix.lat_deg, 8) if fix else None,
        "lon_deg": serialize.plain(fix.lon_deg, 8) if fix else None,
        "accuracy_m": serialize.plain(fix.accuracy_m, 1) if fix else None,
        "sigma_m": serialize.plain(phone_sigma_m(fix.accuracy_m), 1) if fix else None,
        "alt_m": serialize.plain(fix.alt_m, 1) if fix else None,
        "speed_mps": serialize.plain(fix.speed_mps, 2) if fix else None,
        "heading_deg": serialize.plain(fix.heading_deg, 1) if fix else None,
        "at_ms": serialize.plain(fix.at_ms, 0) if fix else None,
        "age_s": serialize.plain(max(0.0, now_s - view.measured_s), 2) if fix else None,
        "used": why is None,
        "why": why,
        "why_text": why_text(why, view, now_s, name).sentence if why else None,
    }
