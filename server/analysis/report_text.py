"""Formats numbers, times and texts of a recording for display."""

from __future__ import annotations

import math


def printable(text: str, most: int = 300) -> str:
    """One line without control characters: the text of a recording must not move a terminal's cursor."""
    flat = "".join(letter if letter.isprintable() else "�" for letter in text)
    return flat if len(flat) <= most else flat[: most - 1] + "…"


def grouped(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def counted(number: int, what: str) -> str:
    return f"{grouped(number)} {what}{'' if number == 1 else 's'}"


def clock(seconds: float) -> str:
    """A moment of a recording: 12.3 s, from ten minutes on 12:34.5."""
    if not math.isfinite(seconds):
        return "—"
    if abs(seconds) < 600:
        return f"{seconds:.1f} s"
    tenths = round(abs(seconds) * 10)
    minutes, rest = divmod(tenths, 600)
    hours, minutes = divmod(minutes, 60)
    sign = "−" if seconds < 0 else ""
    head = f"{hours}:{minutes:02d}" if hours else f"{minutes}"
    return f"{sign}{head}:{rest // 10:02d}.{rest % 10}"


def length(seconds: float) -> str:
    """A duration: 0.4 s, 55.9 s, 12 min 5 s, 2 h 3 min."""
    if seconds < 100:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
