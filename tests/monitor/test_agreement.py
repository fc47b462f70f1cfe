"""The gate and the correlation against what is known of them, and why the plain formula of the report will not do."""

from __future__ import annotations

import math
import random

import pytest

from monitor.agreement import CHI_SQUARE, Pair, correlate, gate_m, phone_sigma_m

PLACE = (32.23, -110.95)
M_NORTH, M_EAST = 1 / 110_890.0, 1 / 94_260.0  # degrees a metre there


def pairs(
    phone: list[tuple[float, float]], car: list[tuple[float, float]], origin: tuple[float, float] = PLACE
) -> list[Pair]:
    """One pair a second, both in metres east and north of an origin (of Tucson's latitude)."""
    lat, lon = origin
    return [
        Pair(
            at_s=float(i),
            phone_lat_deg=lat + p[1] * M_NORTH,
            phone_lon_deg=math.remainder(lon + p[0] * M_EAST, 360.0),
            phone_sigma_m=2.0,
            car_lat_deg=lat + q[1] * M_NORTH,
            car_lon_deg=math.remainder(lon + q[0] * M_EAST, 360.0),
        )
        for i, (p, q) in enumerate(zip(phone, car, strict=True))
    ]


def noise(seed: int, n: int, sigma_m: float) -> list[tuple[float, float]]:
    rng = random.Random(seed)
    return [(rng.gauss(0.0, sigma_m), rng.gauss(0.0, sigma_m)) for _ in range(n)]


def moved(track: list[tuple[float, float]], by: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(a[0] + b[0], a[1] + b[1]) for a, b in zip(track, by, strict=True)]


EASTWARD = [(8.0 * i, 0.0) for i in range(40)]  # 8 m/s along an east-west road
BEND = [(100.0 * math.cos(0.08 * i), 100.0 * math.sin(0.08 * i)) for i in range(40)]
PARKED = [(0.0, 0.0)] * 40


@pytest.mark.parametrize(
    ("accuracy_m", "sigma_m"),
    [(0.0, 2.0), (3.0, 2.0), (3.02, 2.0), (3.03, 3.03 / 1.51), (15.1, 10.0), (50.0, 33.11)],
)
def test_sigma_of_a_phone(accuracy_m: float, sigma_m: float) -> None:
    assert phone_sigma_m(accuracy_m) == pytest.approx(sigma_m, abs=0.005)


@pytest.mark.parametrize(("accuracy_m", "expected_m"), [(3.0, 9), (5.0, 14), (10.0, 25), (20.0, 50)])
def test_the_gate_beside_a_good_receiver_in_a_standing_car(accuracy_m: float, expected_m: int) -> None:
    gate = gate_m(3.0, -4.0, car_sigma_m=0.5, phone_sigma_m=phone_sigma_m(accuracy_m))
    assert gate == pytest.approx(expected_m, abs=0.55)


def test_a_receiver_without_a_covariance_widens_the_gate() -> None:
    assert gate_m(1.0, 0.0, car_sigma_m=5.0, phone_sigma_m=2.0) == pytest.approx(math.sqrt(CHI_SQUARE * 31.0))


@pytest.mark.parametrize("velocity_mps", [(10.0, 0.0), (-10.0, 0.0)])
def test_the_car_s_motion_widens_the_gate_along_the_way_only(velocity_mps: tuple[float, float]) -> None:
    """Along the way Σ is s + (v Δt)², across it s."""
    gate = {
        name: gate_m(*way, car_sigma_m=1.0, phone_sigma_m=2.0, velocity_mps=velocity_mps, uncertain_s=0.5)
        for name, way in {"along": (1.0, 0.0), "back": (-7.0, 0.0), "across": (0.0, 2.0)}.items()
    }
    assert gate["along"] == gate["back"] == pytest.approx(math.sqrt(CHI_SQUARE * (7.0 + 25.0)))
    assert gate["across"] == pytest.approx(math.sqrt(CHI_SQUARE * 7.0))


def test_the_gate_is_the_chi_square_ellipse() -> None:
    """In any direction dᵀΣ⁻¹d of the gate's length is 13.8, by the full matrix."""
    s, u = 1.5**2 + 3.0**2 + 2.0, (8.0 * 0.4, -3.0 * 0.4)
    xx, yy, xy = s + u[0] ** 2, s + u[1] ** 2, u[0] * u[1]
    det = xx * yy - xy * xy
    for degrees in range(0, 360, 15):
        way = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        gate = gate_m(*way, car_sigma_m=1.5, phone_sigma_m=3.0, velocity_mps=(8.0, -3.0), uncertain_s=0.4)
        d = way[0] * gate, way[1] * gate
        d2 = (d[0] ** 2 * yy - 2 * d[0] * d[1] * xy + d[1] ** 2 * xx) / det
        assert d2 == pytest.approx(CHI_SQUARE)


def test_at_one_and_the_same_place_the_gate_is_that_of_any_direction() -> None:
    assert gate_m(0.0, 0.0, car_sigma_m=1.0, phone_sigma_m=2.0) == pytest.approx(math.sqrt(CHI_SQUARE * 7.0))


@pytest.mark.parametrize("track", [EASTWARD, BEND], ids=["eastward", "bend"])
@pytest.mark.parametrize("seed", range(5))
def test_tracks_of_one_car_correlate(track: list[tuple[float, float]], seed: int) -> None:
    found = correlate(pairs(moved(track, noise(seed, 40, 3.0)), moved(track, noise(99, 40, 1.0))))
    assert found.correlation is not None
    assert found.correlation > 0.99
    assert (found.pairs, found.span_s) == (40, 39.0)


def test_another_way_does_not_correlate() -> None:
    found = correlate(pairs([(-x, y) for x, y in BEND], BEND))
    assert found.correlation is not None
    assert found.correlation < 0.3
    assert correlate(pairs([(-x, -y) for x, y in BEND], BEND)).correlation == pytest.approx(-1.0)


def test_a_phone_that_never_moved_has_no_correlation_and_reports_it() -> None:
    found = correlate(pairs(PARKED, EASTWARD))
    assert found.correlation is None
    assert found.phone_spread_m == 0.0
    assert found.car_spread_m == pytest.approx(92.3, abs=0.2)  # 8 m √((40² − 1)/12)


@pytest.mark.parametrize("n", [0, 1])
def test_too_little_is_no_track(n: int) -> None:
    found = correlate(pairs(EASTWARD[:n], EASTWARD[:n]))
    assert (found.pairs, found.span_s, found.correlation, found.car_spread_m) == (n, 0.0, None, 0.0)


def test_across_the_180_meridian_it_is_the_same() -> None:
    here = correlate(pairs(moved(EASTWARD, noise(3, 40, 3.0)), EASTWARD))
    there = correlate(pairs(moved(EASTWARD, noise(3, 40, 3.0)), EASTWARD, origin=(32.23, 179.9985)))
    assert there.correlation == pytest.approx(here.correlation)
    assert there.car_spread_m == pytest.approx(here.car_spread_m)


def test_the_pole_is_no_fault() -> None:
    found = correlate(pairs(EASTWARD, EASTWARD, origin=(90.0 - 1e-9, 0.0)))
    assert found.correlation is None or -1.0 <= found.correlation <= 1.0


# -- the report's own formula ----------------------------------------------------------------------------------------


def report_7_r(a: list[float], b: list[float]) -> float:
    """The design report's correlation coefficient, 5.4: one axis of raw degrees, sums not centred."""
    n = len(a)
    top = n * sum(x * y for x, y in zip(a, b, strict=True)) - sum(a) * sum(b)
    below = (n * sum(x * x for x in a) - sum(a) ** 2) * (n * sum(y * y for y in b) - sum(b) ** 2)
    return top / math.sqrt(below)


def latitudes(track: list[tuple[float, float]]) -> list[float]:
    return [PLACE[0] + north * M_NORTH for _, north in track]


def test_the_report_s_formula_is_noise_for_a_parked_car() -> None:
    """Two good receivers side by side in a parked car: r is anything. Ours: no track, so nothing is reported."""
    found = [report_7_r(latitudes(noise(seed, 40, 1.0)), latitudes(noise(seed + 500, 40, 1.0))) for seed in range(60)]
    assert min(found) < -0.3
    assert max(found) > 0.3
    assert max(found) < 0.7  # a threshold that would pass a moving car fails every parked one
    ours = correlate(pairs(noise(1, 40, 1.0), noise(2, 40, 1.0)))
    assert ours.car_spread_m < 3 * ours.phone_sigma_m  # what the check requires before it uses r


def test_the_report_s_formula_divides_0_by_0_for_a_constant_series() -> None:
    """A standing receiver repeats one number; the uncentred sums then cancel to 0/0, or to rounding errors."""
    with pytest.raises((ZeroDivisionError, ValueError)):
        report_7_r([32.0] * 40, [32.0] * 40)
    assert correlate(pairs(PARKED, PARKED)).correlation is None


def test_the_report_s_formula_is_blind_to_a_constant_offset_of_500_m() -> None:
    """So is every correlation: 1.000, whatever lies between them. The gate finds it."""
    northward = [(0.0, 8.0 * i) for i in range(40)]
    aside = [(east, north + 500.0) for east, north in northward]
    assert report_7_r(latitudes(northward), latitudes(aside)) == pytest.approx(1.0, abs=0.0005)
    assert correlate(pairs(aside, northward)).correlation == pytest.approx(1.0, abs=1e-6)
    assert 500.0 > gate_m(0.0, 500.0, car_sigma_m=5.0, phone_sigma_m=phone_sigma_m(50.0))


def test_the_report_s_formula_rejects_a_healthy_phone_on_an_east_west_road() -> None:
    """Latitude hardly changes on it, so its r is that of the noise: between −0.86 and 0.92. Pooled, both agree."""
    found, ours = [], []
    for seed in range(300):
        # The error of a receiver wanders: a random walk of 0.3 m a second.
        wander = []
        for one in (seed, seed + 1000):
            rng, north = random.Random(one), 0.0
            wander.append([(0.0, north := north + rng.gauss(0.0, 0.3)) for _ in range(40)])
        phone, car = moved(EASTWARD, wander[0]), moved(EASTWARD, wander[1])
        found.append(report_7_r(latitudes(phone), latitudes(car)))
        ours.append(correlate(pairs(phone, car)).correlation or 0.0)
    assert min(found) < -0.8
    assert max(found) > 0.8
    assert sum(r < 0.7 for r in found) > 200  # of 300 healthy drives, by the least of ours
    assert min(ours) > 0.99
