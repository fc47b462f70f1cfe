"""A laser anywhere on a car, and what it sees, by rotation matrices and rays: another geometry than the judge's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Post = tuple[float, float, float]  # x, y, radius in the body frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Laser:
    """Pose in the body frame, and its beams in its own one."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    beams: int = 720
    first_rad: float = -math.pi
    increment_rad: float = math.tau / 720

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Rotation of the laser's axes into the car's: yaw after pitch after roll."""
        cy, sy, cp, sp = (f(a) for a in (self.yaw_rad, self.pitch_rad) for f in (math.cos, math.sin))
        cr, sr = math.cos(self.roll_rad), math.sin(self.roll_rad)
        yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        found: NDArray[np.float64] = yaw @ pitch @ roll
        return found

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors of the beams in the car's axes, shape (n, 2); for a level laser."""
        own = self.first_rad + self.increment_rad * np.arange(self.beams)
        found: NDArray[np.float64] = (self.matrix[:2, :2] @ np.array([np.cos(own), np.sin(own)])).T
        return found

    def ranges(self, posts: list[Post], *, wall_m: float = 25.0) -> NDArray[np.float64]:
        """What each beam measures: the nearest post, else a round wall about the laser."""
        found = np.full(self.beams, wall_m)
        for x, y, radius in posts:
            to = np.array([x - self.x_m, y - self.y_m])
            along = self.directions @ to
            aside_2 = to @ to - along**2
            hit = (along > 0) & (aside_2 < radius**2)
            entry = along - np.sqrt(np.maximum(radius**2 - aside_2, 0.0))
            found = np.where(hit, np.minimum(found, entry), found)
        return found

    def scan(self, posts: list[Post], *, frame: str = "laser", wall_m: float = 25.0) -> dict[str, Any]:
        """The message, as rosbridge spells it."""
        return {
            "header": {"frame_id": frame},
            "angle_min": self.first_rad,
            "angle_max": self.first_rad + (self.beams - 1) * self.increment_rad,
            "angle_increment": self.increment_rad,
            "time_increment": 0.0,
            "scan_time": 0.1,
            "range_min": 0.05,
            "range_max": 100.0,
            "ranges": self.ranges(posts, wall_m=wall_m).tolist(),
        }

    def transform(self, parent: str = "base_link", child: str = "laser") -> dict[str, Any]:
        """One row of a TFMessage."""
        return row(parent, child, self.x_m, self.y_m, quaternion(self.matrix))


def row(
    parent: str,
    child: str,
    x_m: float = 0.0,
    y_m: float = 0.0,
    rotation: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
    z_m: float = 0.0,
) -> dict[str, Any]:
    """One row of a TFMessage."""
    return {
        "header": {"frame_id": parent},
        "child_frame_id": child,
        "transform": {
            "translation": {"x": x_m, "y": y_m, "z": z_m},
            "rotation": dict(zip("xyzw", rotation, strict=True)),
        },
    }


def quaternion(m: NDArray[np.float64]) -> tuple[float, ...]:
    """Of a rotation matrix: the eigenvector of its greatest eigenvalue (Bar-Itzhack)."""
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    vectors = np.linalg.eigh(k)[1]
    return tuple(float(one) for one in vectors[:, -1])
