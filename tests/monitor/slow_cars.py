"""Cars that are ordered to slow down, and do or do not: their true motion, and their speed as it is reported."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import numpy as np

from monitor.shell_facts import SlowingFacts
from monitor.slow_proof import ProofFollower, SlowProof

ORDERED_S = 100.0
KNOWN_S = 4.0  # of the motion before the order
WATCHED_S = 6.5
RESOLUTION_S = 0.01
MANNERS = ("cruise", "brakes", "begins to brake", "coasts", "accelerates", "eases off", "downhill", "stands", "wavers")


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowCar:
    """One car and its order. `lag_s`: until it reacts at all, then its deceleration builds up with `builds_s`."""

    manner: str
    speed_mps: float  # at the order
    own_mps2: float  # how hard it brakes, coasts or accelerates by itself
    began_s: float  # before the order: since when it brakes
    complies: bool
    lag_s: float
    builds_s: float
    deceleration_mps2: float
    rate_hz: float
    noise_mps: float
    quantum_mps: float
    dropout: float  # share of the speeds that are lost
    freezes: bool  # the reported speed stays as it was at the order
    seed: int

    @property
    def responds_s(self) -> float:
        """When the deceleration is there, after the order."""
        return self.lag_s + self.builds_s

    def times_s(self) -> np.ndarray:
        return np.arange(-KNOWN_S, WATCHED_S, RESOLUTION_S)

    def own_acceleration(self) -> np.ndarray:
        """Without the order."""
        times, a = self.times_s(), self.own_mps2
        match self.manner:
            case "brakes":
                return np.full(len(times), -a)
            case "begins to brake":
                return np.where(times >= -self.began_s, -a, 0.0)
            case "coasts":
                return -(0.10 + 0.15 * a) * np.exp(-times / 20.0)
            case "accelerates" | "downhill":
                return np.full(len(times), a)
            case "eases off":  # it accelerated, and rolls on
                return np.where(times < self.began_s - 0.75, a, -0.15)
            case "wavers":  # a cruise control around its set speed
                return 0.25 * np.cos(2 * math.pi * (times / 4.0 + self.began_s))
        return np.zeros(len(times))

    def true_speeds(self) -> np.ndarray:
        times, own = self.times_s(), self.own_acceleration()
        if self.manner == "stands":
            return np.zeros(len(times))
        if self.complies:
            since = times - self.lag_s
            share = np.where(since > 0, 1 - np.exp(-np.maximum(since, 0) / max(self.builds_s, 1e-6)), 0.0)
            own = own + (np.minimum(own, -self.deceleration_mps2) - own) * share
        speeds = np.cumsum(own) * RESOLUTION_S
        speeds += self.speed_mps - speeds[int(KNOWN_S / RESOLUTION_S)]
        return np.maximum(speeds, 0.0)

    def reported(self) -> tuple[np.ndarray, np.ndarray]:
        rng = np.random.default_rng(self.seed)
        truth = self.true_speeds()
        times = np.arange(-KNOWN_S + rng.uniform(0, 1 / self.rate_hz), WATCHED_S, 1 / self.rate_hz)
        times = times[rng.random(len(times)) >= self.dropout]
        speeds = np.interp(times, self.times_s(), truth) + rng.normal(0, self.noise_mps, len(times))
        if self.quantum_mps:
            speeds = np.round(speeds / self.quantum_mps) * self.quantum_mps
        if self.freezes:
            speeds[times > 0] = speeds[times <= 0][-1]
        return times, speeds

    def judged(self) -> SlowProof:
        """What is shown in the end, on a clock on which the order is given at 0."""
        follower = ProofFollower()
        facts = SlowingFacts(
            is_armed=True, ordered_s=ORDERED_S, sending_s=ORDERED_S, deceleration_mps2=self.deceleration_mps2
        )
        is_ordered = False
        times, speeds = self.reported()
        for at_s, speed in zip(times.tolist(), speeds.tolist(), strict=True):
            if at_s > 0.0 and not is_ordered:
                follower.order(facts)
                is_ordered = True
            follower.add(ORDERED_S + at_s, speed)
            if follower.proof.shown is not None:
                break
        return follower.proof


def random_car(rng: random.Random, *, complies: bool) -> SlowCar:
    """Any car. One that complies is one whose motion the order changes: it does not brake as hard already."""
    deceleration = rng.choice((1.5, 1.5, 1.0, 2.0, 3.0, rng.uniform(1.0, 4.6)))
    manner = rng.choice(
        [name for name in MANNERS if not (complies and name in ("stands", "brakes", "begins to brake"))]
    )
    return SlowCar(
        manner=manner,
        speed_mps=rng.uniform(0.3, 15.0) if not complies else rng.uniform(1.2 * deceleration + 0.5, 15.0),
        own_mps2=rng.uniform(0.1, 1.5) if manner != "brakes" else rng.uniform(0.1, 4.0),
        began_s=rng.uniform(0.5, 3.0),
        complies=complies,
        lag_s=rng.uniform(0.1, 1.0),
        builds_s=rng.choice((0.0, 0.1, 0.2, 0.4)),
        deceleration_mps2=deceleration,
        rate_hz=rng.uniform(5.0, 50.0) if complies else rng.choice((5.0, 10.0, 20.0, 50.0, rng.uniform(5.0, 50.0))),
        noise_mps=rng.uniform(0.0, 0.1) if complies else rng.choice((0.0, 0.02, 0.05, 0.1, rng.uniform(0.0, 0.1))),
        quantum_mps=rng.choice((0.0, 0.0, 0.01, 0.05, 0.1) if complies else (0.0, 0.0, 0.01, 0.05, 0.1, 0.28)),
        dropout=rng.choice((0.0, 0.0, 0.1, 0.3)) if not complies else rng.choice((0.0, 0.0, 0.1)),
        freezes=False if complies else rng.random() < 0.05,
        seed=rng.getrandbits(32),
    )
