"""`python -m tests.server.storage.make_data_folder FILE.zip [--project CHECKOUT]`: a data folder of a killed server.

It is small, and holds settings, paired devices, an alarm log, two recordings (one complete, one cut off), annotations,
mail that was sent and mail that waits, and certificates; and beside it `facts.json`: what the server answered before it
was killed. `--project` names a checkout of another version, whose server writes it. Nothing in it belongs to anybody.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.mail.post import posting
from tests.server.storage.usual_work import TOO_FAST_MPS, Phone, Process, finished, paired
from tests.server.viewer import Viewer
from tests.tree import PROJECT

SAVED_PATHS = ("/api/settings", "/api/devices", "/api/log.json", "/api/recordings", "/api/mail", "/api/mail/settings")
BEAMS = 21
OF_A_RUN = ("exports", "lock", "mail/work", "mail/lock", "access/running.json", "access/waiting")


async def make(out: Path, project: Path) -> None:
    """Writes `out`/data and `out`/facts.json."""
    bridge = RosBridge(ros_version=1)
    port = await bridge.start("127.0.0.1", 0)
    bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    bridge.advertise("/scan", "sensor_msgs/LaserScan")
    speed = [4.2]
    server = Process(out, project=project)
    try:
        base = await server.address()
        async with (
            posting(out / "post") as post,
            driving(bridge, speed=lambda n: speed[0], scans=True, steers=True, beams=BEAMS),
            paired(base) as phone,
            phone.page() as page,
        ):
            recording = await _drive(phone, page, f"ws://127.0.0.1:{port}", speed)
            await _write(phone, recording, post.port)
            facts = await _facts(phone, recording)
            assert (await page.ask(within_s=30, kind="record", on=True))["ok"]
            await page.state(lambda s: s["recording"].get("messages", 0) > 40, within_s=20)
            await asyncio.sleep(1.0)  # some chunks are on the disk
            server.kill()
    finally:
        server.kill()
        await bridge.stop()
    (out / "facts.json").write_text(json.dumps(facts, indent=1, ensure_ascii=False) + "\n")
    for path in (
        *(out / "data" / name for name in OF_A_RUN),
        *out.rglob("*.sqlite-shm"),
        out / "post",
        out / "out.txt",
    ):
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


async def _drive(phone: Phone, page: Viewer, car: str, speed: list[float]) -> str:
    """A drive with an alarm, and the id of its recording."""
    await page.ask(within_s=30, kind="control", do="take")
    assert (await page.ask(within_s=30, kind="set", values={"speed_limit.max_mps": 9.5}))["ok"]
    assert (await page.ask(within_s=30, kind="connect", address=car))["ok"]
    await page.state(lambda s: s["recording"]["state"] == "recording", within_s=20)
    speed[0] = TOO_FAST_MPS
    event = await page.until(lambda: next((e for e in page.events if e["alarm"] == "speed_limit"), None), 20)
    await page.ask(within_s=30, kind="acknowledge", alarm="speed_limit", occurrence=event["occurrence"])
    await asyncio.sleep(1.0)
    speed[0] = 4.2
    await page.until(
        lambda: next((e for e in page.events if e["alarm"] == "speed_limit" and e["change"] == "cleared"), None), 20
    )
    assert (await page.ask(within_s=30, kind="record", on=False))["ok"]
    found: str = await phone.until("/api/recordings", finished)
    return found


async def _write(phone: Phone, recording: str, smtp_port: int) -> None:
    """What people write: annotations, devices, mail; one mail is sent, the next waits for ever."""
    await phone.ask(
        "PATCH", f"/api/recordings/{recording}", json={"title": "First lap", "note": "wet", "tags": ["wet"]}
    )
    async with paired(str(phone.client.base_url).rstrip("/"), "Tablet", "viewer"):
        pass
    account = {"host": "127.0.0.1", "port": smtp_port, "security": "none", "sender": "car@test.example"}
    order = {"recordings": [recording], "to": ["ann@example.org"], "format": "csv", "subject": "Sent"}
    await phone.ask("PUT", "/api/mail/settings", json=account)
    number = (await phone.ask("POST", "/api/mail", json=order)).json()["n"]
    await phone.until(f"/api/mail/{number}", lambda found: found["state"] == "sent")
    nobody = {"port": 9, "user": "car", "password": "not-a-secret"}
    await phone.ask("PUT", "/api/mail/settings", json=account | nobody)
    number = (await phone.ask("POST", "/api/mail", json=order | {"subject": "Waits"})).json()["n"]
    await phone.until(
        f"/api/mail/{number}", lambda found: found["is_ready"] and found["state"] not in ("sent", "failed")
    )


async def _facts(phone: Phone, recording: str) -> dict[str, Any]:
    cookie = next(iter(phone.client.cookies.jar))
    answers = {path: (await phone.ask("GET", path)).json() for path in SAVED_PATHS}
    return {
        "at_ms": round(time.time() * 1000),
        "cookie": f"{cookie.name}={cookie.value}",
        "recording": recording,
        "answers": answers,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--project", type=Path, default=PROJECT)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        asyncio.run(make(Path(work), args.project))
        shutil.make_archive(str(args.out.with_suffix("")), "zip", work)
