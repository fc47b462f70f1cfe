"""What a departure check uses of the car and its server, from the parts of a session."""

from __future__ import annotations

from typing import Any

from server.control.departure_sight import Seen
from server.vehicle.session_parts import SessionParts


def seen_of(parts: SessionParts, now_s: float, wall_ms: int) -> Seen:
    """`wall_ms`: the time of day at `now_s`."""
    judgement, recorder = parts.judgement, parts.recording.frame(now_s)
    snapshot = judgement.snapshot()
    brake, accelerator = (_fresh(parts, name, now_s) for name in ("brake", "accelerator"))
    steering = _fresh(parts, "steering", now_s)
    ahead_s = judgement.transport.clock.ahead_s
    rates = {
        source.topic.lower(): rate.measured_hz
        for name, source in parts.connection.subscriptions.signals.sources.items()
        if (rate := snapshot.rates.get(name)) is not None
    }
    return Seen(
        is_monitored=parts.connection.phase == "monitoring",
        checks={name: (str(one.verdict), one.text) for name, one in judgement.monitor.findings.items()},
        rates_hz=rates,
        is_recording=recorder["state"] == "recording",
        recorder=recorder.get("reason") or "",
        phones=parts.authorization.facts(now_s).can,
        room_gb=recorder.get("room_gb"),
        ahead_s=None if ahead_s is None else ahead_s + now_s - wall_ms / 1000,
        brake_percent=None if brake is None else brake.percent,
        accelerator_percent=None if accelerator is None else accelerator.percent,
        tyre_rad=None if steering is None else steering.tyre_rad,
        speed_mps=speed_of(parts, now_s),
        slow_down=parts.slow_down.frame()["state"],
    )


def speed_of(parts: SessionParts, now_s: float) -> float | None:
    """The measured speed; None while it is not fresh."""
    found = _fresh(parts, "speed", now_s)
    return None if found is None else float(found.speed_mps)


def _fresh(parts: SessionParts, signal: str, now_s: float) -> Any:
    reading = parts.judgement.state.get(signal)
    return reading.value if reading is not None and reading.is_fresh(now_s) else None
