"""The seconds before an intervention as a small SVG. Only numbers of ours are put into it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from server.analysis.drive.axis import Scale, ticks
from server.analysis.drive.drawings import path, sign_at, svg

BEFORE_S = 10.0
BREAK_S = 1.2  # without a sample for longer: the line ends
WIDTH, HEIGHT = 260.0, 76.0


def before_plot(one: Mapping[str, Any]) -> Markup | None:
    """The speed in the 10 s before an intervention; None: fewer than two samples."""
    samples = [(at_s, abs(mps)) for at_s, mps in one["before"] if -BEFORE_S - 0.5 <= at_s <= 0.05]
    if len(samples) < 2:
        return None
    marks = ticks(0.0, max(max(mps for _, mps in samples), 1.0), 2)
    x, y = Scale(-BEFORE_S, 0.0, 34.0, WIDTH - 14), Scale(0.0, marks[-1], HEIGHT - 22, 22.0)
    parts = [
        f'<path class="{"grid" if mark else "axis"}" d="M34 {y(mark):.1f}H{WIDTH - 14:g}"/>'
        f'<text x="28" y="{y(mark) + 4.5:.1f}" text-anchor="end">{mark:g}</text>'
        for mark in (marks[0], marks[-1])
    ]
    parts += [f'<path class="line" d="{path([(x(s), y(mps)) for s, mps in line])}"/>' for line in _lines(samples)]
    parts.append(f'<path class="axis" d="M{x(0):.1f} 16V{HEIGHT - 22:g}"/>')
    parts.append(sign_at("wheel", x(0), 8.0))
    parts.append('<text x="28" y="11" text-anchor="end">m/s</text>')
    for at_s, anchor, words in (
        (-BEFORE_S, "start", "−10 s"),
        (-BEFORE_S / 2, "middle", "−5 s"),
        (0.0, "end", "0"),
    ):
        parts.append(f'<text x="{x(at_s):.1f}" y="{HEIGHT - 4:g}" text-anchor="{anchor}">{words}</text>')
    return svg(WIDTH, HEIGHT, parts, "Speed in the 10 s before it")


def _lines(samples: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    lines: list[list[tuple[float, float]]] = []
    for at_s, mps in samples:
        if not lines or at_s - lines[-1][-1][0] > BREAK_S:
            lines.append([])
        lines[-1].append((at_s, mps))
    return lines
