"""A process that records the simulated car at full load until it is killed, and reports what it has passed on.

Every message has its number as its time, so that counting alone shows what is readable afterwards.
"""

from __future__ import annotations

import time
from multiprocessing.connection import Connection
from pathlib import Path

from server.recording.folder import RecordingsFolder
from server.recording.recorder import Recorder
from server.recording.recorder_queue import Part
from server.recording.space import Allowance
from server.simulator.car import SimulatedCar

BEGAN_NS = 1_700_000_000_000_000_000
REPORT_S = 0.01


MISSING = {"left_out": "/camera", "left_out_count": "1", "not_received": "/imu", "not_received_count": "1"}


def record_until_killed(root: Path, reports: Connection, part_s: float) -> None:
    """A new part begins every `part_s`, and notes 0.1 s later what is MISSING in it.

    Reports the monotonic time [ns], which all processes share, and how many messages were handed over before it."""
    folder = RecordingsFolder(root)
    recorder = Recorder(
        folder,
        call=lambda function, *arguments: function(*arguments),
        on_finished=lambda path: None,
        allowance=Allowance(quota=0, min_free=0),
    )
    recorder.prepare()
    while recorder.queued or not recorder.is_ready:
        time.sleep(0.01)
    began_s = time.monotonic()
    handed, parts, noted, reported_s = 0, 0, 0, 0.0
    for message in (car := SimulatedCar(seed=1)).messages():
        due_s = began_s + car.elapsed_s
        if (wait_s := due_s - time.monotonic()) > 0:
            time.sleep(wait_s)
        now_s = time.monotonic() - began_s
        if now_s >= parts * part_s:
            if parts:
                recorder.end(ended="closed")
            parts += 1
            path = folder.place("car", f"car_{parts:04}")
            recorder.begin(Part(path=path, version=1, metadata={"vehicle": "car", "part": str(parts)}))
        if noted < parts and now_s >= (parts - 1) * part_s + 0.1:
            noted = parts
            recorder.note(**MISSING)
        recorder.take(message.topic, message.type, message.message, BEGAN_NS + handed, 400, now_s)
        handed += 1
        if now_s - reported_s >= REPORT_S:
            reported_s = now_s
            reports.send((time.monotonic_ns(), handed))
