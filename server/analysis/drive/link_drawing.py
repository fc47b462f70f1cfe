"""The drawings of the link in a drive's report as SVG. Only numbers of ours are put into them."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from server.analysis.drive.axis import Scale, nice_step, ticks
from server.analysis.drive.drawings import Point, extremes, hatch, horizontal, not_known, path, svg, time_axis
from server.recording.drive.facts import DriveFacts
from server.recording.drive.link_way import LinkStretch


def along_way(facts: DriveFacts, stretches: Sequence[LinkStretch], width: float, height: float) -> Markup | None:
    """The delay of the link over the distance driven; None: it was not recorded, or no distance is known."""
    delays = [one.most_s for one in stretches if one.most_s is not None]
    if not delays:
        return None
    top, bottom, left, right = 10.0, height - 24.0, 42.0, width - 8
    marks, length_m = ticks(0.0, max(max(delays) * 1000, 20.0), 3), stretches[-1].to_m
    x, y = Scale(0.0, length_m, left, right), Scale(0.0, marks[-1], bottom, top)
    parts = horizontal(marks, y, left, right)
    for from_s, to_s in facts.motion.blind_spans()[:200]:
        parts.append(hatch(x(facts.motion.until(from_s) or 0.0), x(facts.motion.until(to_s) or 0.0), top, bottom))
    for of, style in (("most_s", "line thin dots"), ("delay_s", "line")):
        for piece in _pieces(stretches, of):
            line = [(x(end_m), y(late_s * 1000)) for from_m, to_m, late_s in piece for end_m in (from_m, to_m)]
            parts.append(f'<path class="{style}" d="{path(line)}"/>')
    step_m = nice_step(length_m, 4)
    for number in range(int(length_m / step_m) + 1):
        px, at_m = x(number * step_m), number * step_m
        name = f"{at_m / 1000:g}" if length_m >= 1000 else f"{at_m:g}"
        unit = (" km" if length_m >= 1000 else " m") if number == int(length_m / step_m) else ""
        anchor = "end" if px > width - 40 else "start" if px < 60 else "middle"
        parts.append(
            f'<path class="axis" d="M{px:.1f} {bottom:.1f}v5"/>'
            f'<text x="{px:.1f}" y="{bottom + 18:.1f}" text-anchor="{anchor}">{name}{unit}</text>'
        )
    return svg(width, height, parts, "Delay of the link over the distance driven, in milliseconds")


def _pieces(stretches: Sequence[LinkStretch], of: str) -> list[list[tuple[float, float, float]]]:
    """From, to [m] and delay [s], in pieces between stretches that have none."""
    pieces: list[list[tuple[float, float, float]]] = [[]]
    for one in stretches:
        late_s: float | None = getattr(one, of)
        if late_s is not None:
            pieces[-1].append((one.from_m, one.to_m, late_s))
        elif pieces[-1]:
            pieces.append([])
    return [piece for piece in pieces if piece]


def over_time(facts: DriveFacts, width: float, height: float) -> Markup | None:
    """The delay of the link over time; None: it was not recorded."""
    held = facts.held_delays()
    if not held:
        return None
    top, bottom, left, right = 10.0, height - 24.0, 42.0, width - 8
    marks = ticks(0.0, max(max(late_s for _, _, late_s in held) * 1000, 20.0), 3)
    x, y = Scale(0.0, max(facts.length_s, 0.1), left, right), Scale(0.0, marks[-1], bottom, top)
    parts = horizontal(marks, y, left, right) + not_known(facts, x, top, bottom)
    lines: list[list[Point]] = [[]]
    before_s = 0.0
    for from_s, late_ms in extremes([(from_s, late_s * 1000) for from_s, _, late_s in held]):
        gap = next((gap for gap in facts.gaps if before_s <= gap[0] and gap[1] <= from_s), None)
        if lines[-1]:  # a delay holds until the next one is written
            lines[-1].append((x(from_s if gap is None else gap[0]), lines[-1][-1][1]))
        if gap is not None:
            lines.append([])
        lines[-1].append((x(from_s), y(late_ms)))
        before_s = from_s
    lines[-1].append((x(facts.length_s), lines[-1][-1][1]))
    parts += [f'<path class="line thin" d="{path(line)}"/>' for line in lines if line]
    parts += time_axis(facts, x, bottom, width)
    return svg(width, height, parts, "Delay of the link over time, in milliseconds")
