"""Straight lines through reported speeds, with their errors, and fits with at most two changes of slope."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

BIN_S = 0.04  # speeds that come faster are averaged
FINEST_STEP_MPS = 1e-4  # values nearer to each other differ by rounding
ROLLS_OUT_MPS2 = 0.15  # by which a car may slow without any cause of its own


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A straight line through speeds, with its standard errors; times count from the first command."""

    level_mps: float
    slope_mps2: float
    level_error_mps: float
    slope_error_mps2: float
    sigma_mps: float  # of one speed

    def lowest_mps(self, at_s: float) -> float:
        slope_mps2 = min(0.0, self.slope_mps2 - 2 * self.slope_error_mps2) - ROLLS_OUT_MPS2
        return self.level_mps - 2 * self.level_error_mps + slope_mps2 * at_s


def line(times: Floats, values: Floats, least_sigma: float) -> Line:
    middle_s = float(times.mean())
    spread = float(((times - middle_s) ** 2).sum())
    slope = float(((times - middle_s) * values).sum()) / spread
    level = float(values.mean()) - slope * middle_s
    rest = values - level - slope * times
    sigma = math.sqrt(max(float(rest @ rest) / (len(times) - 2), least_sigma**2))
    return Line(
        level_mps=level,
        slope_mps2=slope,
        level_error_mps=sigma * math.sqrt(1 / len(times) + middle_s**2 / spread),
        slope_error_mps2=sigma / math.sqrt(spread),
        sigma_mps=sigma,
    )


def binned(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Means over BIN_S; a line through them is a line through the speeds."""
    bins = np.floor(times / BIN_S)
    starts = np.flatnonzero(np.diff(bins, prepend=-math.inf))
    counts = np.diff(np.append(starts, len(times)))
    return np.add.reduceat(times, starts) / counts, np.add.reduceat(values, starts) / counts


def quantum(before: Floats, after: Floats) -> float:
    """The step in which the speed is reported, as far as it shows; 0: it shows none."""
    values = np.unique(np.concatenate((before, after)))
    gaps = np.diff(values)
    gaps = gaps[gaps > FINEST_STEP_MPS]
    return float(gaps.min()) if len(gaps) else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Speeds as a line with at most one change before the order and one after it: least squares for all pairs."""

    times: Floats
    values: Floats
    early: Floats  # seconds before the order
    late: Floats  # and after it
    rests: Floats  # sums of squares without a late change: of no early change, then of each
    rest_with: float  # the least, with one
    pair: tuple[int, int]  # the changes that leave it; the first counts from 1, 0: none

    @classmethod
    def of(cls, times: Floats, values: Floats, early: Floats, late: Floats) -> Fit:
        base = np.stack((np.ones_like(times), times - times.mean()), axis=1)
        base /= np.sqrt((base * base).sum(axis=0))
        every = np.concatenate(
            (np.maximum(0.0, times[:, None] + early), np.maximum(0.0, times[:, None] - late)), axis=1
        )
        every -= base @ (base.T @ every)
        first, second = every[:, : len(early)], every[:, len(early) :]
        rest = values - base @ (base.T @ values)
        square = float(rest @ rest)
        weight = np.maximum((first * first).sum(axis=0), 1e-9)
        along = rest @ first
        rests = np.append(square, np.maximum(0.0, square - along * along / weight))
        common = first.T @ second
        left = np.maximum(
            (second * second).sum(axis=0) - np.vstack((0.0 * common[:1], common**2 / weight[:, None])), 1e-9
        )
        towards = rest @ second - np.vstack((0.0 * common[:1], common * (along / weight)[:, None]))
        gains = np.where(towards < 0.0, towards * towards / left, 0.0)
        with_both = np.maximum(0.0, rests[:, None] - gains)
        at = int(np.argmin(with_both))
        pair = divmod(at, len(late))
        return cls(
            times=times, values=values, early=early, late=late, rests=rests, rest_with=float(with_both[pair]), pair=pair
        )

    def rest_without(self, unsure_s: float) -> float:
        """The least without a late change, where an early one is no later than `unsure_s` before the order."""
        return float(self.rests[np.append(True, self.early >= unsure_s - 1e-9)].min())

    @property
    def changed_s(self) -> float:
        return float(self.late[self.pair[1]])

    def slopes(self) -> tuple[float, float]:
        """The change of slope at the late change, and the slope from then on [m/s²]."""
        columns = [np.ones_like(self.times), self.times, np.maximum(0.0, self.times - self.changed_s)]
        if self.pair[0]:
            columns.append(np.maximum(0.0, self.times + self.early[self.pair[0] - 1]))
        found = np.linalg.lstsq(np.stack(columns, axis=1), self.values, rcond=None)[0]
        return float(found[2]), float(found[1:].sum())


def least_chi2(freedom: int) -> float:
    """A sum of squares is smaller in one case of a hundred only (Wilson and Hilferty, PNAS 17, 1931)."""
    share = 2.0 / (9.0 * freedom)
    return max(0.02, float(freedom * max(0.0, 1.0 - share - 2.33 * math.sqrt(share)) ** 3))
