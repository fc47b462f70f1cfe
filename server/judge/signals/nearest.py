"""The nearest object, by the car's own estimator: distance and bearing."""

from __future__ import annotations

import math
from typing import Any

from monitor.values import Bearing, Distance
from server.judge.message_fields import Rejected, finite
from server.judge.topic import Topic, floats

NONE_REAL_M, NONE_SIMULATED_M = 81.0, 180.0  # value of the distance estimator for nothing ahead: car, simulator
FARTHEST_M = 1000.0  # beyond any sensor's range; the steering-based variant sends 2147483647 before the first object


def distance(message: Any) -> Distance:
    value = finite(message, "data")
    if value < 0:
        raise Rejected("a distance below zero")
    if value >= FARTHEST_M or abs(value - NONE_REAL_M) < 1e-3 or abs(value - NONE_SIMULATED_M) < 1e-3:
        return Distance(distance_m=None, none_in_range=True)
    return Distance(distance_m=value, none_in_range=False)


def bearing(message: Any) -> Bearing:
    value = finite(message, "data")
    if abs(value) > 2 * math.pi:
        raise Rejected("an angle beyond a full turn")
    return Bearing(bearing_rad=value)


TOPICS = (
    Topic(
        signal="distance",
        queue_length=10,
        names=(
            "/DistanceEstimator/dist",
            "/catvehicle/distanceEstimator/dist",
            "/catvehicle/distanceEstimatorSteeringBased/dist",
        ),
        types=floats(distance),
    ),
    Topic(
        signal="bearing",
        queue_length=10,
        names=(
            "/DistanceEstimator/angle",
            "/catvehicle/distanceEstimator/angle",
            "/catvehicle/distanceEstimatorSteeringBased/angle",
        ),
        types=floats(bearing),
    ),
)
