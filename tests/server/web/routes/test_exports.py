"""Exports and clips over HTTP: begun, followed, fetched in parts, cancelled, swept away; refusals as sentences."""

from __future__ import annotations

import asyncio
import time
import zipfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest
import pytest_asyncio

from server.app.config import Config
from server.recording.export.clip import Window
from server.recording.export.jobs import KEEP_BYTES, KEEP_S, MOST_WAITING, NOT_WHOLE, Exports, Job, NotYet, TooMany
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving
from tests.server.recording.drive.story import in_two_parts, recorded
from tests.server.recording.export.ours import OurFile
from tests.server.recording.made import BEGAN_MS, record

DRIVE, STILL = "car_20260921T141320Z", "car_20260921T151320Z"
JOB = {"job", "of", "format", "state", "progress", "sentence", "notes", "is_whole", "size_bytes", "recording"}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data = tmp_path_factory.mktemp("data")
    record(data / "recordings" / "car" / f"{DRIVE}.mcap", alarms=[(5.0, "critical")], seconds=20.0)
    record(data / "recordings" / "car" / f"{STILL}.mcap", began_ms=BEGAN_MS + 3_600_000, at=None)
    return data


@pytest_asyncio.fixture
async def client(data: Path) -> AsyncIterator[httpx.AsyncClient]:
    async with (
        serving(Config(vehicles=(Vehicle(name="car"),), data=data)) as base,
        httpx.AsyncClient(base_url=base, timeout=60) as client,
    ):
        async with asyncio.timeout(60):
            while len((await client.get("/api/recordings")).json()["recordings"]) < 2:
                await asyncio.sleep(0.05)
        yield client


async def over(client: httpx.AsyncClient, job: dict[str, Any]) -> dict[str, Any]:
    assert job.keys() == JOB
    progress = 0.0
    async with asyncio.timeout(60):
        while job["state"] in ("waiting", "working"):
            await asyncio.sleep(0.05)
            job = (await client.get(f"/api/exports/{job['job']}")).json()
            assert job["sentence"].endswith(".")
            assert 0.0 <= progress <= job["progress"] <= 1.0
            progress = job["progress"]
    return job


def problem(answer: httpx.Response, status: int) -> str:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    detail: str = answer.json()["detail"]
    assert detail.endswith(".")
    return detail


async def begin(client: httpx.AsyncClient, format: str, id: str = DRIVE) -> dict[str, Any]:
    answer = await client.post(f"/api/recordings/{id}/exports", json={"format": format})
    assert answer.status_code == 202, answer.text
    found: dict[str, Any] = answer.json()
    return found


async def test_an_export_is_begun_followed_and_fetched_in_parts(client: httpx.AsyncClient, tmp_path: Path) -> None:
    await client.patch(f"/api/recordings/{DRIVE}", json={"title": "Skid pad: 2"})
    job = await over(client, await begin(client, "bag"))
    assert (job["state"], job["of"], job["format"], job["progress"]) == ("done", DRIVE, "bag", 1.0)
    whole = await client.get(f"/api/exports/{job['job']}/file")
    assert whole.headers["content-type"] == "application/x-rosbag"
    assert f'filename="{DRIVE} Skid pad_ 2.bag"' in whole.headers["content-disposition"]
    assert len(whole.content) == job["size_bytes"]
    part = await client.get(f"/api/exports/{job['job']}/file", headers={"Range": "bytes=4-19"})
    assert (part.status_code, part.content) == (206, whole.content[4:20])
    assert (await client.head(f"/api/exports/{job['job']}/file")).headers["content-length"] == str(len(whole.content))
    (tmp_path / "out.bag").write_bytes(whole.content)
    with open_recording([tmp_path / "out.bag"]) as bag:
        assert {t: i.count for t, i in bag.topics.items()} == {
            "/catvehicle/vel": 201,
            "/gps_fix": 101,
            "/catgraph/alarms": 2,
        }
    again = await begin(client, "bag")
    assert again["job"] == job["job"]  # what is there is not made twice
    assert (await client.get("/api/exports")).json()["exports"] == [again]


@pytest.mark.field
@pytest.mark.parametrize(
    ("format", "begins"),
    [("bag", b"#ROSBAG V2.0\n"), ("csv", b"PK"), ("gpx", b"<?xml"), ("geojson", b'{"type":'), ("html", b"<!doctype")],
)
async def test_every_format_by_one_address(client: httpx.AsyncClient, format: str, begins: bytes) -> None:
    answer = await client.get(f"/api/recordings/{DRIVE}/export/{format}")
    assert answer.status_code == 200, answer.text
    assert answer.content[:9].lower().startswith(begins[:9].lower())
    assert int(answer.headers["content-length"]) == len(answer.content)


@pytest.mark.field
async def test_refusals(client: httpx.AsyncClient) -> None:
    assert problem(await client.get("/api/recordings/nobody/export/bag"), 404) == "There is no such recording."
    assert (await client.get("/api/recordings/..%2Fsecret/export/bag")).status_code == 404
    assert problem(await client.get("/api/recordings/.../export/bag"), 404)
    assert problem(await client.get(f"/api/recordings/{DRIVE}/export/exe"), 422)
    assert problem(await client.post(f"/api/recordings/{DRIVE}/exports", json={"format": "mcap"}), 422)
    assert (
        problem(await client.get("/api/exports/0123"), 404) == "There is no such export; exports are kept for an hour."
    )
    assert problem(await client.delete("/api/exports/0123"), 404)
    assert "export a ROS 1 bag" in problem(await client.get(f"/api/recordings/{DRIVE}/export/ros2"), 422)
    sentence = problem(await client.get(f"/api/recordings/{STILL}/export/gpx"), 422)
    assert sentence == "No position was recorded in this drive: there is no track to export."
    failed = await over(client, await begin(client, "gpx", STILL))
    assert (failed["state"], failed["sentence"]) == ("failed", sentence)
    assert problem(await client.get(f"/api/exports/{failed['job']}/file"), 422) == sentence


async def test_cancelling_ends_the_work_and_leaves_nothing(client: httpx.AsyncClient, data: Path) -> None:
    first, second = await begin(client, "html"), await begin(client, "csv")
    assert problem(await client.get(f"/api/exports/{second['job']}/file"), 409) == "It is not ready yet."
    for job in (second, first):
        assert (await client.delete(f"/api/exports/{job['job']}")).json() == {"ok": True, "state": "cancelled"}
    assert list((data / "exports").glob("*/*")) == []
    assert problem(await client.get(f"/api/exports/{first['job']}/file"), 409) == "It was cancelled."
    done = await over(client, await begin(client, "csv"))
    assert done["state"] == "done"
    assert (await client.delete(f"/api/exports/{done['job']}")).json()["ok"]
    assert list((data / "exports").glob("*/*")) == []


@pytest.mark.field
async def test_a_clip_is_a_recording_and_a_page(client: httpx.AsyncClient, data: Path) -> None:
    at_ms = BEGAN_MS + 5000
    answer = await client.post(f"/api/recordings/{DRIVE}/clip", json={"at_ms": at_ms, "before_s": 2, "after_s": 3})
    assert answer.status_code == 202, answer.text
    job = await over(client, answer.json())
    assert (job["state"], job["notes"]) == ("done", [])
    assert job["recording"].startswith(f"{DRIVE}_clip_")
    async with asyncio.timeout(30):
        while (await client.get(f"/api/recordings/{job['recording']}")).json().get("is_clip") is not True:
            await asyncio.sleep(0.05)
    path = data / "recordings" / "car" / f"{job['recording']}.mcap"
    with open_recording([path]) as cut:
        assert {t: i.count for t, i in cut.topics.items()} == {"/catvehicle/vel": 51, "/gps_fix": 26}
        assert [event["change"] for _, event in cut.own("/catgraph/alarms")] == ["raised", "cleared"]
        assert (cut.metadata["clip_of"], cut.metadata["clip_at_ms"]) == (DRIVE, str(at_ms))
    page = (await client.get(f"/api/recordings/{job['recording']}/export/html")).text
    assert "catgraph incident" in page
    assert "A critical alarm: raised" in page
    path.unlink()


@pytest.mark.field
async def test_the_report_of_any_part_is_that_of_the_whole_drive(tmp_path: Path) -> None:
    car = tmp_path / "recordings" / "car"
    car.mkdir(parents=True)
    for name, path in zip((DRIVE, f"{DRIVE}_p2"), in_two_parts(tmp_path), strict=True):
        path.rename(car / f"{name}.mcap")
    (tmp_path / "other").mkdir()
    recorded(tmp_path / "other", name=f"{STILL}.mcap", session="another").rename(car / f"{STILL}.mcap")

    def are_read(rows: list[dict[str, Any]]) -> bool:
        return [row["state"] for row in rows] == ["read"] * 3

    async with (
        serving(Config(vehicles=(Vehicle(name="car"),), data=tmp_path)) as base,
        httpx.AsyncClient(base_url=base, timeout=60) as client,
    ):
        async with asyncio.timeout(60):
            while not are_read((await client.get("/api/recordings")).json()["recordings"]):
                await asyncio.sleep(0.05)
        second, first = [await begin(client, "report_json", id) for id in (f"{DRIVE}_p2", DRIVE)]
        assert first["job"] == second["job"]
        await over(client, first)
        found = (await client.get(f"/api/exports/{first['job']}/file")).json()
        assert [part["recording"] for part in found["parts"]] == [DRIVE, f"{DRIVE}_p2"]
        assert (found["name"], found["figures"]["driven_s"], len(found["gaps"])) == (DRIVE, 180.0, 1)
        alone = (await client.get(f"/api/recordings/{STILL}/export/report_json")).json()
        assert [part["recording"] for part in alone["parts"]] == [STILL]
        track = (await client.get(f"/api/recordings/{DRIVE}_p2/export/geojson")).json()
        assert track["features"], "other formats are of one recording"
        drives = (await client.get("/api/logbook")).json()["drives"]
        assert sorted(drive["recordings"] for drive in drives) == [[DRIVE, f"{DRIVE}_p2"], [STILL]]


async def test_clips_that_cannot_be(client: httpx.AsyncClient) -> None:
    async def clip(**body: Any) -> httpx.Response:
        return await client.post(f"/api/recordings/{DRIVE}/clip", json=body)

    assert problem(await clip(at_ms=time.time() * 1000 + 100_000), 422) == "This time is in the future."
    assert problem(await clip(at_ms=BEGAN_MS, before_s=-1), 422)
    assert problem(await clip(at_ms=BEGAN_MS, after_s=4000), 422)
    assert problem(await clip(), 422)
    job = await over(client, (await clip(at_ms=1000.0)).json())
    assert job["state"] == "failed"
    assert job["sentence"] == "Nothing was recorded from 1969-12-31 23:59:31 to 1970-01-01 00:00:31 UTC."


# -- the jobs themselves, with a clock of the test's own ---------------------------------------------------------------


class Bench:
    """Exports over a folder with one drive, without a server."""

    def __init__(self, folder: Path) -> None:
        self.now_s = 0.0
        self.wall_ms: Callable[[], int] = lambda: time.time_ns() // 1_000_000
        self.made: list[Path] = []
        self.root = folder / "recordings"
        recordings = RecordingsFolder(self.root)
        self.exports = Exports(
            folder / "exports",
            recordings,
            recordings.path_of,
            self.made.append,
            now=lambda: self.now_s,
            wall_ms=lambda: self.wall_ms(),
        )
        self.files = folder / "exports"

    async def done(self, job: Job) -> Job:
        async with asyncio.timeout(60):
            await job.finished.wait()
        return job

    async def left(self, count: int) -> None:
        """Returns once so many files are left: a thread removes them."""
        async with asyncio.timeout(20):
            while len(list(self.files.glob("*/*"))) != count:
                await asyncio.sleep(0.01)


@pytest_asyncio.fixture
async def bench(tmp_path: Path) -> AsyncIterator[Bench]:
    bench = Bench(tmp_path)
    record(bench.root / "car" / f"{DRIVE}.mcap", seconds=5.0)
    await bench.exports.start()
    yield bench
    await bench.exports.stop()


async def test_what_nobody_fetches_is_swept_away(bench: Bench) -> None:
    job = await bench.done(await bench.exports.begin(DRIVE, "geojson"))
    assert job.path is not None
    assert job.path.exists()
    bench.now_s = KEEP_S
    assert bench.exports.job(job.id) is job
    bench.now_s = KEEP_S + 1.0
    assert bench.exports.job(job.id) is None
    await bench.left(0)


async def test_one_that_still_tidies_up_is_not_taken_for_an_old_one(bench: Bench) -> None:
    bench.now_s = 2 * KEEP_S  # of a clock that began when the machine did
    wide = Window(at_ns=BEGAN_MS * 1_000_000, before_s=1.0, after_s=4.0)
    job = await bench.exports.clip(DRIVE, wide)
    async with asyncio.timeout(60):
        while not job.finished.is_set():
            assert bench.exports.job(job.id) is job
            await asyncio.sleep(0)
    assert job.state == "done"


@pytest.mark.field
async def test_the_oldest_goes_where_they_are_too_large_together(bench: Bench) -> None:
    jobs = []
    for n, format in enumerate(("geojson", "gpx", "csv")):
        bench.now_s = float(n)
        jobs.append(await bench.done(await bench.exports.begin(DRIVE, format)))
    jobs[1].size = KEEP_BYTES
    assert [job.format for job in bench.exports.jobs()] == ["csv"]  # the newest stays, whatever its size
    await bench.left(1)


async def test_no_more_than_some_wait(bench: Bench) -> None:
    begun = [await bench.exports.clip(DRIVE, Window(at_ns=(BEGAN_MS + n) * 1_000_000)) for n in range(MOST_WAITING)]
    with pytest.raises(TooMany):
        await bench.exports.begin(DRIVE, "csv")
    same = await bench.exports.clip(DRIVE, Window(at_ns=BEGAN_MS * 1_000_000))
    assert same is begun[0]
    await asyncio.gather(*(bench.exports.cancel(job.id) for job in reversed(begun)))
    assert {job.state for job in begun} == {"cancelled"}
    assert (await bench.done(await bench.exports.begin(DRIVE, "geojson"))).state == "done"


async def test_starting_sweeps_up_what_a_killed_server_left(bench: Bench) -> None:
    (bench.files / "old").mkdir(parents=True)
    (bench.files / "old" / "a.bag").write_bytes(b"x")
    await bench.exports.start()
    assert not bench.files.exists()


async def test_a_clip_of_what_is_being_recorded_waits_for_its_end(bench: Bench) -> None:
    """The alarm was just now: the clip waits until the seconds after it are there."""
    begin_ns = time.time_ns() - 2_000_000_000
    path = bench.root / "car" / "car_20261121T120000Z.mcap"
    writing = OurFile(path)

    def speak(at_ns: int) -> None:
        writing.own(at_ns, "/catgraph/link", {"phase": "monitoring"})
        writing.write(at_ns, "/n", "std_msgs/Int32", "int32 data", "ros1", b"\1\0\0\0")
        writing.flush()

    for n in range(20):
        speak(begin_ns + n * 100_000_000)
    at_ns = time.time_ns()
    job = await bench.exports.clip("car_20261121T120000Z", Window(at_ns=at_ns, before_s=1.0, after_s=1.5))
    sentences = set()
    while not job.finished.is_set():
        speak(time.time_ns())
        sentences.add(job.sentence.partition(":")[0])
        await asyncio.sleep(0.05)
    assert "Waiting for 2 s after it to be recorded" in sentences
    assert (job.state, job.notes) == ("done", [])
    assert job.recording is not None
    with open_recording([bench.made[0]]) as cut:
        times = [message.at_s for message in cut.messages()]
    assert times[0] <= (at_ns - 0.9e9) / 1e9
    assert times[-1] >= (at_ns + 1.4e9) / 1e9
    writing.close()


@pytest.mark.field
async def test_a_clip_of_a_recording_that_ended_does_not_wait_longer(bench: Bench) -> None:
    writing = OurFile(bench.root / "car" / "car_20261121T120000Z.mcap")
    now_ns = time.time_ns()
    writing.write(now_ns, "/n", "std_msgs/Int32", "int32 data", "ros1", b"\1\0\0\0")
    writing.flush()
    job = await bench.exports.clip("car_20261121T120000Z", Window(at_ns=now_ns, before_s=1.0, after_s=30.0))
    await asyncio.sleep(0.3)
    assert not job.is_over
    writing.close()
    began_s = time.monotonic()
    await bench.done(job)
    assert time.monotonic() - began_s < 15.0
    assert job.state == "done"
    assert any("ends 30.0 s before the clip should" in note for note in job.notes)


async def test_a_clip_reaches_into_the_next_part(bench: Bench) -> None:
    record(bench.root / "car" / f"{DRIVE}_p2.mcap", seconds=5.0, began_ms=BEGAN_MS + 6000)
    (bench.root / "car" / f"{DRIVE}_p3.mcap").write_bytes(b"spoilt")
    window = Window(at_ns=(BEGAN_MS + 5000) * 1_000_000, before_s=2.0, after_s=2.0)
    job = await bench.done(await bench.exports.clip(DRIVE, window))
    assert (job.state, job.notes) == ("done", [])
    with open_recording([bench.made[0]]) as cut:
        assert (cut.topics["/catvehicle/vel"].count, round(cut.duration_s, 1)) == (21 + 11, 4.0)
    late = Window(at_ns=(BEGAN_MS + 10_000) * 1_000_000, before_s=2.0, after_s=2.0)
    job = await bench.done(await bench.exports.clip(f"{DRIVE}_p2", late))  # beside a part that nobody can read
    assert job.state == "done"


async def test_a_part_that_cannot_be_read_spoils_no_report(bench: Bench) -> None:
    (bench.root / "car" / f"{DRIVE}_p2.mcap").write_bytes(b"spoilt")
    bench.exports._drive_of = lambda id: [DRIVE, f"{DRIVE}_p2"]
    job = await bench.done(await bench.exports.begin(DRIVE, "report_json"))
    assert (job.state, job.is_whole, job.sentence) == ("done", False, NOT_WHOLE)
    assert any(note.startswith(f"{DRIVE}_p2.mcap ") for note in job.notes)
    assert await bench.exports.begin(DRIVE, "report_json") is job
    assert await bench.exports.begin(f"{DRIVE}_p2", "report_json") is not job


async def test_a_moment_far_ahead_is_refused(bench: Bench) -> None:
    with pytest.raises(NotYet):
        await bench.exports.clip(DRIVE, Window(at_ns=time.time_ns() + 50_000_000_000))


@pytest.mark.field
async def test_an_export_does_not_hold_up_the_loop(bench: Bench) -> None:
    """Twenty times a second something wants to run, as the judge does: it is not kept waiting by an export."""
    record(bench.root / "car" / "long.mcap", seconds=600.0)
    job = await bench.exports.begin("long", "csv")
    lags = []
    while not job.finished.is_set():
        due_s = time.perf_counter() + 0.01
        await asyncio.sleep(0.01)
        lags.append(time.perf_counter() - due_s)
    assert job.state == "done"
    lags.sort()
    assert len(lags) > 50
    assert lags[len(lags) * 95 // 100] < 0.05  # in the loop itself it would be seconds
    with zipfile.ZipFile(job.path or "") as packed:
        assert "speed.csv" in packed.namelist()


async def test_a_worker_that_dies_is_a_failure_with_a_sentence(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.recording.export.worker._ROOT", bench.root)  # where there is no catgraph
    monkeypatch.setenv("PYTHONPATH", "")
    monkeypatch.setattr("sys.executable", "/bin/false")
    job = await bench.done(await bench.exports.begin(DRIVE, "csv"))
    assert job.state == "failed"
    assert job.sentence == "The export failed: it ran out of memory or was killed."


def test_a_job_is_plain_json() -> None:
    job = Job(id="a", of="b", format="bag", key=())
    assert orjson.loads(orjson.dumps(job.as_json())).keys() == JOB
