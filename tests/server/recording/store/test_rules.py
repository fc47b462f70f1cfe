"""When a whole file is sent, around which moments clips are made, and how the address of a store is read."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest

from server.recording.store.address import BadStore, Login, store_address
from server.recording.store.names import PART_BYTES, part_count, part_key, part_size, place_of, row_key
from server.recording.store.object_store import Pace
from server.recording.store.plan import backoff_ms
from server.recording.store.rules import (
    MOST_CLIPS,
    Place,
    Situation,
    StoreRule,
    WholeFiles,
    is_interface_up,
    moments_of,
    why_not_whole,
)
from server.recording.store.trouble import Kind, of_answer

DEPOT = StoreRule(whole=WholeFiles.IN_DEPOT, lat_deg=32.2319, lon_deg=-110.9501, radius_m=100.0)
THERE = Place(lat_deg=32.2325, lon_deg=-110.9501, speed_mps=0.0)  # 67 m to the north
NAN = float("nan")


@pytest.mark.parametrize(
    ("rule", "place", "is_asked", "is_up", "is_sent"),
    [
        (StoreRule(whole=WholeFiles.NEVER), THERE, False, True, False),
        (StoreRule(whole=WholeFiles.NEVER), THERE, True, True, False),
        (StoreRule(whole=WholeFiles.ON_REQUEST), THERE, False, True, False),
        (StoreRule(whole=WholeFiles.ON_REQUEST), Place(), True, False, True),
        (StoreRule(whole=WholeFiles.ALWAYS), Place(), False, False, True),
        (DEPOT, THERE, False, False, True),
        (DEPOT, Place(lat_deg=32.2325, lon_deg=-110.9501, speed_mps=0.5), False, False, False),  # it drives
        (DEPOT, Place(lat_deg=32.2325, lon_deg=-110.9501, speed_mps=-0.5), False, False, False),  # backwards
        (DEPOT, Place(lat_deg=32.2325, lon_deg=-110.9501), False, False, False),  # nobody knows whether it drives
        (DEPOT, Place(lat_deg=32.2329, lon_deg=-110.9501, speed_mps=0.0), False, False, False),  # 111 m
        (DEPOT, Place(lat_deg=NAN, lon_deg=NAN, speed_mps=0.0), False, False, False),
        (DEPOT, Place(lat_deg=32.2325, lon_deg=-110.9501, speed_mps=NAN), False, False, False),
        (DEPOT, Place(), False, False, False),
        (DEPOT, Place(), False, True, True),  # its network is there
        (DEPOT, Place(), True, False, True),
        (StoreRule(whole=WholeFiles.IN_DEPOT), Place(lat_deg=0.0, lon_deg=0.0, speed_mps=0.0), False, False, False),
    ],
)
def test_the_table_of_rules(rule: StoreRule, place: Place, is_asked: bool, is_up: bool, is_sent: bool) -> None:
    why = why_not_whole(Situation(rule=rule, place=place), is_asked=is_asked, is_on_depot_network=is_up)
    assert (why is None) is is_sent
    assert why is None or why.endswith(".")


@pytest.mark.parametrize(("state", "is_up"), [("up\n", True), ("down\n", False), ("dormant\n", False), (None, False)])
def test_an_interface_that_is_connected(tmp_path: Path, state: str | None, is_up: bool) -> None:
    if state is not None:
        (tmp_path / "wlan0").mkdir()
        (tmp_path / "wlan0" / "operstate").write_text(state)
    assert is_interface_up("wlan0", tmp_path) is is_up
    assert is_interface_up(None, tmp_path) is False


def test_moments_of_clips_do_not_overlap_and_the_worst_come_first() -> None:
    assert moments_of([{"at_ms": 10_000, "priority": "warning"}, {"at_ms": 20_000, "priority": "critical"}]) == [20_000]
    assert moments_of([{"at_ms": 10_000, "priority": "advisory"}]) == []
    many = [{"at_ms": n * 60_000, "priority": "warning"} for n in range(30)]
    chosen = moments_of([*many, {"at_ms": 4_000_000, "priority": "critical"}])
    assert (len(chosen), chosen[-1]) == (MOST_CLIPS, 4_000_000)


def test_names_of_parts() -> None:
    assert [part_count(size) for size in (0, 1, PART_BYTES, PART_BYTES + 1)] == [1, 1, 1, 2]
    assert [part_size(PART_BYTES + 5, n) for n in (1, 2, 3)] == [PART_BYTES, 5, 0]
    assert part_key("car 1", "x", "mcap", 1, 1) == "files/car-1/x/x.mcap"
    assert part_key("car 1", "x", "mcap", 2, 3) == "files/car-1/x/x.mcap.part-00002"
    assert place_of(row_key("car", "car_1")) == ("car", "car_1")
    assert [place_of(key) for key in ("catalogue/../x.json", "catalogue/a/b/c.json", "files/a/b.json")] == [None] * 3


def test_the_pace_is_kept_and_checks_whether_it_may_continue() -> None:
    now = 0.0
    checked = []

    def sleep(s: float) -> None:
        nonlocal now
        now += s

    pace = Pace(lambda: 1000.0, lambda: checked.append(now), now=lambda: now, sleep=sleep)
    for _ in range(10):
        pace.take(500)
    assert now == pytest.approx(5.0)
    assert max(b - a for a, b in itertools.pairwise(checked)) <= 0.2 + 1e-9
    Pace(lambda: 0.0, lambda: None, now=lambda: now, sleep=sleep).take(10**9)
    assert now == pytest.approx(5.0)


def test_the_pause_after_failures_grows_to_ten_minutes() -> None:
    assert [backoff_ms(n) for n in (1, 2, 3, 8, 1000)] == [5_000, 10_000, 20_000, 600_000, 600_000]


ENVIRONMENT = {"AWS_ACCESS_KEY_ID": "an-id", "AWS_SECRET_ACCESS_KEY": "hidden"}


def test_an_address_and_its_login() -> None:
    there = store_address("s3://bucket/a/b/", endpoint="https://store.example:9000/", environment=ENVIRONMENT)
    assert (there.bucket, there.prefix, there.endpoint, there.text) == (
        "bucket", "a/b", "https://store.example:9000", "s3://bucket/a/b",
    )  # fmt: skip
    assert there.login == Login(key_id="an-id", secret="hidden")
    assert "hidden" not in repr(there)
    assert (
        store_address("s3://bucket", environment=ENVIRONMENT | {"AWS_ENDPOINT_URL": "http://x"}).endpoint == "http://x"
    )


@pytest.mark.parametrize(
    "text", ["bucket", "s3://", "s3://B", "s3://bucket/../x", "s3://bucket/a b", "http://x", "s3://bucket//a"]
)
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(BadStore, match="no address"):
        store_address(text.replace("//a", "/a//b"), environment=ENVIRONMENT)


@pytest.mark.parametrize("endpoint", ["store", "ftp://x", "https://u:p@x", "https://x/path", "http://x:99999"])
def test_what_is_no_endpoint(endpoint: str) -> None:
    with pytest.raises(BadStore, match="endpoint") as why:
        store_address("s3://bucket", endpoint=endpoint, environment=ENVIRONMENT)
    assert "u:p" not in str(why.value)


def test_a_login_from_a_file_that_others_cannot_read(tmp_path: Path) -> None:
    key = tmp_path / "store.toml"
    with pytest.raises(BadStore, match="needs a login"):
        store_address("s3://bucket", environment={})
    with pytest.raises(BadStore, match="cannot be read"):
        store_address("s3://bucket", key_file=key, environment={})
    key.write_text('access_key_id = "a"\nsecret_access_key = "b"\n')
    os.chmod(key, 0o644)
    with pytest.raises(BadStore, match="chmod 600"):
        store_address("s3://bucket", key_file=key, environment={})
    os.chmod(key, 0o600)
    assert store_address("s3://bucket", key_file=key, environment={}).login == Login(key_id="a", secret="b")
    key.write_text("access_key_id = 3\n")
    with pytest.raises(BadStore, match="two lines"):
        store_address("s3://bucket", key_file=key, environment={})


@pytest.mark.parametrize(
    ("status", "code", "kind", "text"),
    [
        (507, "", Kind.FULL, "is full"),
        (500, "XMinioStorageFull", Kind.FULL, "is full"),
        (403, "AccessDenied", Kind.FORBIDDEN, "refuses the login (AccessDenied)"),
        (403, "RequestTimeTooSkewed", Kind.FORBIDDEN, "set its clock"),
        (404, "NoSuchBucket", Kind.NO_BUCKET, "has no bucket b"),
        (404, "NoSuchKey", Kind.MISSING, "does not have the object"),
        (503, "SlowDown", Kind.BUSY, "requests a pause"),
        (400, "AuthorizationHeaderMalformed", Kind.OTHER, "--store-region"),
        (500, "InternalError", Kind.OTHER, "status 500 (InternalError)"),
    ],
)
def test_the_text_of_troubles(status: int, code: str, kind: Kind, text: str) -> None:
    trouble = of_answer(status, code, host="h", bucket="b")
    assert trouble.kind is kind
    assert text in str(trouble)
