"""`ulimit -n` truly exhausted in the middle of an order, by connections that somebody opens: it is an alarm, the server
survives, the slow-down goes on, and all is well when they have gone."""

from __future__ import annotations

import contextlib
import os
import resource
import socket
from pathlib import Path

import httpx
import pytest

from tests.page.processes import running, server
from tests.server.slowdown.conftest import Field, simulated

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120), pytest.mark.world(n=24)]

MORE = 40  # files and connections that may still be opened


def open_files(pid: int) -> int:
    return len(os.listdir(f"/proc/{pid}/fd"))


def cpu_s(pid: int) -> float:
    """Processor time of it so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.field
async def test_an_order_goes_on_where_no_file_can_be_opened_any_more(tmp_path: Path) -> None:
    async with simulated() as (service, address), running(*server(tmp_path, address)) as process:
        assert process._process is not None
        pid = process._process.pid
        one_connection = httpx.Limits(max_connections=1, max_keepalive_connections=1, keepalive_expiry=60.0)
        async with httpx.AsyncClient(base_url=process.address, timeout=10.0, limits=one_connection) as client:
            car = Field(service, client)
            await car.armed(5.0)
            before_s = cpu_s(pid)
            await car.until(lambda state: state["session"]["received"] > 200)
            hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)[1]
            most = open_files(pid) + MORE
            resource.prlimit(pid, resource.RLIMIT_NOFILE, (most, hard))
            host, port = process.shown.split(":")
            with contextlib.ExitStack() as opened:
                for _ in range(2 * MORE):
                    opened.enter_context(socket.create_connection((host, int(port)), timeout=5.0))
                state = await car.until(lambda _: open_files(pid) >= most - 1)
                received = state["session"]["received"]
                await car.until(lambda state: state["session"]["received"] > received + 300)
                assert (await car.post("order")).is_success
                state = await car.until(
                    lambda state: any(alarm["id"] == "monitoring_impaired" for alarm in state["alarms"])
                )
                texts = [str(alarm) for alarm in state["alarms"] if alarm["id"] == "monitoring_impaired"]
                assert "files and connections" in texts[0]
                assert (await client.get("/api/health")).json()["status"] != "ok"
                await car.until(lambda state: state["decelerate"]["order"]["confirmed"])
                await car.until(lambda state: state["decelerate"]["state"] == "holding")
                await car.until(lambda _: car.speed_mps < 0.1)
                used_s = cpu_s(pid) - before_s
                gaps = [b - a for (a, _), (b, _) in zip(car.speeds, car.speeds[1:], strict=False)]
                print(f"{used_s:.1f} s of processor time, at most {max(gaps):.3f} s between two commands")
                assert max(gaps) < 0.5, "the commands never paused"
            await car.until(
                lambda state: not any(a["id"] == "monitoring_impaired" and a["active"] for a in state["alarms"])
            )
        async with httpx.AsyncClient(base_url=process.address, timeout=10.0) as another:
            assert (await another.get("/api/state")).is_success
