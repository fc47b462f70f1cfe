"""The speed over a whole recording as some hundred numbers: what a time line draws."""

from __future__ import annotations

from collections.abc import Sequence

BUCKETS = 360  # two pixels each on a phone
LEAST_BUCKET_S = 0.5


class SpeedTrace:
    """The highest speed of each bucket. Times are seconds since the beginning of the recording, speeds m/s."""

    def __init__(self, length_s: float) -> None:
        self.bucket_s = max(LEAST_BUCKET_S, length_s / BUCKETS)
        self.speed_mps: list[float | None] = [None] * (int(length_s / self.bucket_s) + 1)

    def add(self, at_s: float, speed_mps: float) -> None:
        """A speed that was measured; its sign does not count."""
        place = min(len(self.speed_mps) - 1, int(at_s / self.bucket_s))
        if place >= 0:
            before = self.speed_mps[place]
            self.speed_mps[place] = abs(speed_mps) if before is None else max(before, abs(speed_mps))

    def rounded(self) -> list[float | None]:
        """With one decimal, which is enough for a sketch."""
        return [None if speed is None else round(speed, 1) for speed in self.speed_mps]

    def completed(self, done_s: float, sketch: Sequence[float | None]) -> list[float | None]:
        """These speeds up to `done_s`, and after it those of a sketch of the same recording."""
        if not sketch:
            return list(self.speed_mps)
        per_place = len(sketch) / len(self.speed_mps)
        return [
            speed if speed is not None or (place + 1) * self.bucket_s <= done_s else sketch[int(place * per_place)]
            for place, speed in enumerate(self.speed_mps)
        ]
