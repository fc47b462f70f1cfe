"""The binary scan of docs/protocol.md, read by another hand than the one that writes it."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanFrame:
    """What a page is sent of one scan."""

    number: int
    age_s: float
    stopping_m: float | None
    angle_min_rad: float
    angle_increment_rad: float
    range_max_m: float
    gap_m: float
    tyre_angle_rad: float
    wider_m: float
    beam: int
    codes: npt.NDArray[np.uint16]

    @property
    def scale_m(self) -> float:
        return max(self.range_max_m, 0.1) / 65000


def read(frame: bytes) -> ScanFrame:
    """Asserts the shape, gives the rest."""
    magic, version, beams, number, age_ms, stopping_cm = struct.unpack_from("<BBHIHH", frame)
    angle_min, increment, range_max, gap, tyre, wider, beam = struct.unpack_from("<ffffbBH", frame, 12)
    assert (magic, version) == (0x53, 2)
    assert len(frame) == 32 + 2 * beams
    return ScanFrame(
        number=number,
        age_s=age_ms / 1000,
        stopping_m=None if stopping_cm == 65535 else stopping_cm / 100,
        angle_min_rad=angle_min,
        angle_increment_rad=increment,
        range_max_m=range_max,
        gap_m=gap,
        tyre_angle_rad=tyre * 0.005,
        wider_m=wider / 100,
        beam=beam,
        codes=np.frombuffer(frame[32:], dtype="<u2"),
    )
