"""What a page saw over a radio, in the figures of docs/numbers.md."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise


def at(values: list[float], share: float) -> float:
    """The quantile of sorted values; infinity where there are none."""
    return values[int(share * (len(values) - 1))] if values else float("inf")


@dataclass(slots=True)
class Seen:
    """Lines of page.mjs. Times are ms since 1970, ages seconds."""

    begins_ms: float = 0.0
    frames: list[tuple[float, float]] = field(default_factory=list)  # time, true age
    cars: list[tuple[float, float, bool, str]] = field(default_factory=list)  # time, how late, cut, alarms
    samples: list[tuple[float, bool, float, float]] = field(default_factory=list)  # time, covered, shown, true age
    dials: list[float] = field(default_factory=list)  # times
    fresh: list[tuple[float, float]] = field(default_factory=list)  # time, true age of the oldest value drawn as fresh

    def read(self, line: str) -> None:
        match line.split():
            case ["begins", time]:
                self.begins_ms = float(time)
            case ["b", time, age, late, cut, alarms]:
                self.frames.append((float(time), float(age) / 1000))
                self.cars.append((float(time), float(late), cut == "1", alarms))
            case ["d", time]:
                self.dials.append(float(time))
            case ["f", time, age]:
                self.fresh.append((float(time), float(age) / 1000))
            case ["s", time, covered, shown, true]:
                self.samples.append((float(time), covered == "1", float(shown) / 1000, float(true) / 1000))

    def between(self, from_ms: float, to_ms: float) -> Seen:
        return Seen(
            from_ms,
            [one for one in self.frames if from_ms <= one[0] < to_ms],
            [one for one in self.cars if from_ms <= one[0] < to_ms],
            [one for one in self.samples if from_ms <= one[0] < to_ms],
            [one for one in self.dials if from_ms <= one < to_ms],
            [one for one in self.fresh if from_ms <= one[0] < to_ms],
        )

    @property
    def lasts_s(self) -> float:
        return (self.samples[-1][0] - self.samples[0][0]) / 1000 if len(self.samples) > 1 else 0.0

    @property
    def ages(self) -> list[float]:
        return sorted(age for _, age in self.frames)

    @property
    def gap_s(self) -> float:
        """The longest time without a fresh frame."""
        times = [self.samples[0][0], *(time for time, _ in self.frames), self.samples[-1][0]] if self.samples else []
        return max((b - a for a, b in pairwise(times)), default=0.0) / 1000

    @property
    def veiled(self) -> float:
        return sum(covered for _, covered, _, _ in self.samples) / max(1, len(self.samples))

    @property
    def youngest_s(self) -> float:
        """By how much the most an age was shown that was too small; negative: too small."""
        return min((shown - true for _, covered, shown, true in self.samples if not covered), default=0.0)

    @property
    def oldest_fresh_s(self) -> float:
        """The most that was the true age of a value that was drawn as fresh."""
        return max((age for _, age in self.fresh), default=0.0)

    def first_s(self, from_ms: float) -> float:
        """From then to the first fresh frame."""
        return min((time for time, _ in self.frames if time >= from_ms), default=float("inf")) / 1000 - from_ms / 1000

    def live_s(self, from_ms: float) -> float:
        """From then until the values are uncovered."""
        times = (time for time, covered, _, _ in self.samples if time >= from_ms and not covered)
        return min(times, default=float("inf")) / 1000 - from_ms / 1000

    def row(self) -> str:
        ages = self.ages
        return (
            f"{len(self.frames) / max(0.001, self.lasts_s):4.1f}/s  age {at(ages, 0.5):.2f}/{at(ages, 0.95):.2f}/"
            f"{at(ages, 1.0):.2f} s  gap {self.gap_s:.1f} s  veiled {self.veiled:.0%}  "
            f"dials {60 * len(self.dials) / max(0.001, self.lasts_s):.1f}/min  "
            f"shown − true ≥ {self.youngest_s:+.2f} s"
        )

    def car_row(self) -> str:
        late = sorted(late_s for _, late_s, is_cut, _ in self.cars if not is_cut and late_s == late_s)
        many = max(1, len(self.cars))
        alarms = {name for *_, names in self.cars for name in names.split(",")} - {"-"}
        return (
            f"late {at(late, 0.5):.2f}/{at(late, 0.95):.2f}/{at(late, 1.0):.2f} s  "
            f"cut {sum(is_cut for _, _, is_cut, _ in self.cars) / many:.0%}  "
            f"called late {sum('link_late' in names for *_, names in self.cars) / many:.0%}  "
            f"alarms {', '.join(sorted(alarms)) or 'none'}"
        )

    def car_back_s(self, from_ms: float) -> float:
        """From then until the link to the car is not cut."""
        times = (time for time, _, is_cut, _ in self.cars if time >= from_ms and not is_cut)
        return min(times, default=float("inf")) / 1000 - from_ms / 1000
