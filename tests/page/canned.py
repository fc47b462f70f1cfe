"""Serves the real page and speaks docs/protocol.md with frames that are set by hand: any state, at once, for as long
as a test looks at it. Screenshots are made of it, and what depends on the page alone is tested with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import copy
import math
import struct
import time
from collections.abc import Callable
from typing import Any, cast

import uvicorn
from fastapi import FastAPI, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.templating import Jinja2Templates

from monitor.tracks import TrackPoint
from server.access.people import People
from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.judge.topics import candidates
from server.recording.catalog.sketch import sketch
from server.system.page_files import static_dir, templates_dir
from server.vehicle.car_departure import CarDeparture, DepartureFile
from server.web.assets.bundle import find
from server.web.assets.static_files import StaticText
from server.web.middleware.http_protocol import PageSocket
from server.web.routes.pages import PageFiles
from server.web.routes.recordings import listed_formats
from tests.page.canned_drive import CannedDrive

Json = dict[str, Any]
TILES = (
    "Speed", "Obstacle", "Pedals", "GPS fix", "GPS drift", "Phone–car", "Tracks", "Laser", "Scan shape", "Signals",
    "Moving", "Diagnostics", "Command", "Recorder",
)  # fmt: skip
UNKNOWN = {"GPS drift": "not checked: moving", "Command": "not checked: not armed"}


def signal(label: str, kind: str | None, value: Json | None, **more: Any) -> Json:
    """One signal of a state, fresh unless set otherwise."""
    hz = more.pop("hz", 20.0)
    known = value is not None
    return {
        "label": label, "unit": "", "freshness": "fresh" if known else "not_published",
        "age_s": 0.02 if known else None, "delay_s": 0.0 if known else None, "unusable": None,
        "horizon_s": max(1.0, 10 / hz), "period_s": 1 / hz, "expected_hz": hz, "rate_hz": hz,
        "topic": f"/catvehicle/{label.lower()}" if known else None, "type": kind, "note": None,
        "why": "by its name" if known else None, "frame": None,
        "count": 1118 if known else 0, "rejected": 0, "rejected_why": None, "repaired": 0,
        "repaired_why": None, "value": value,
        "lowest": None, "highest": None, **more,
    }  # fmt: skip


def live() -> Json:
    """The state the pictures of the design show: driving at 4.2 m/s with an object 12.4 m ahead."""
    diagnostics = "diagnostic_msgs/DiagnosticArray"
    twist, wrench, number = "geometry_msgs/Twist", "geometry_msgs/Wrench", "std_msgs/Float64"
    return {
        "kind": "state", "vehicle": "car",
        "server": {
            "time_ms": 0, "boot": "9f00", "version": "0.1.0", "pages": 1, "frames_skipped": 0, "loop_lag_ms": 0.4,
        },
        "session": {
            "phase": "monitoring", "address": "ws://192.168.4.1:9090", "name": "192.168.4.1:9090", "ros_version": 1,
            "connected_for_s": 252.3, "paused": False, "paused_for_s": 0.0, "track_m": 76.1, "received": 14228,
            "rejected": 0, "track": {"number": 1, "last": 7}, "configured": None, "profile": "CATVehicle",
            "settings_version": 0, "paused_by": None, "held": None,
        },
        "link": {
            "cut": None, "since_ms": None, "bridge_age_s": 0.05, "car_age_s": 0.05, "problem": None, "attempts": 0,
            "trying_for_s": 0.0, "topics_subscribed": 14, "topics_heard": 12, "late_s": None,
            "most_late_s": None, "reduced": None,
            "unreadable_frames": 0, "unreadable_why": None,
        },
        "signals": {
            "speed": signal("Speed", twist, {"speed_mps": 4.2, "yaw_rate_radps": None}, age_s=0.04),
            "acceleration": signal("Acceleration", twist, {"acceleration_mps2": 0.3, "source": "speed"}),
            "brake": signal("Brake", wrench, {"percent": 0.0}, age_s=0.04),
            "accelerator": signal("Accelerator", wrench, {"percent": 14.1}, age_s=0.05),
            "steering": signal("Steering", wrench, {"percent": -4.0, "tyre_rad": None}, age_s=0.04),
            "distance": signal("Nearest distance", number, {"distance_m": 12.4, "none_in_range": False}, hz=74.8),
            "bearing": signal("Nearest angle", number, {"bearing_rad": -0.052}, hz=74.8, age_s=0.01),
            "odometry": signal(
                "Odometry", "nav_msgs/Odometry", {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "speed_mps": 4.19}
            ),
            "position": signal(
                "Position", "sensor_msgs/NavSatFix",
                {"lat_deg": 32.231904, "lon_deg": -110.950116, "alt_m": 748.3, "status": 0, "sigma_m": 5.0,
                 "covariance_m2": None},
                hz=10.0,
            ),
            "heading": signal("Heading", "nav_msgs/Odometry", {"heading_deg": 87.0, "source": "odometry"}),
            "scan": signal(
                "Laser", "sensor_msgs/LaserScan",
                {"beams": 181, "usable": 164, "nearest_m": 3.2, "nearest_bearing_rad": 1.5, "frame_id": "laser",
                 "angle_min_rad": -1.571, "angle_increment_rad": 0.017453, "range_min_m": 0.1, "range_max_m": 81.0},
                hz=75.0,
            ),
            "diagnostics": signal("Diagnostics", diagnostics, {"worst": 0, "components": []}, hz=1.0),
            "command": signal("Command", None, None),
            "fuel": signal("Fuel", None, None),
            "mode": signal("Driving mode", None, None),
        },
        "nearest": {"time_gap_s": 3.0, "stopping_m": 7.1},
        "checks": [
            {"id": tile, "label": tile, "verdict": "unknown" if tile in UNKNOWN else "ok", "text": "",
             "brief": UNKNOWN.get(tile, "OK"), "checks": [tile]}
            for tile in TILES
        ],
        "alarms": [],
        "suppressed": [],
        "alarm_load": {"in_10_min": 0, "flood": False, "bearable": True, "chattering": []},
        "log_trouble": None,
        "trends": trends(1500.4, 1200, 4),
        "limits": {
            "speed_limit.max_mps": 11.0, "gauge.speed_max_mps": 15.0, "gauge.acceleration_max_mps2": 3.0,
            "obstacle.standoff_m": 5.0, "obstacle.half_width_m": 1.2, "obstacle.wheelbase_m": 2.62,
            "obstacle.laser_ahead_m": 2.5,
        },
        "recording": {"state": "recording", "for_s": 252.0},
        "decelerate": slow("not_available", why="/catvehicle/cmd_vel is not on the car."),
        "mode": {"mode": "unknown", "why": "no_source", "since_ms": None, "way_m": None, "source": "", "open": []},
        "control": {"holder": "You"},
        "reach": None,
        "marks": 0,
        "questions": [],
        "phones": [],
        "phone": {
            "id": "9c0f", "label": "Pixel 7", "count": 1, "handheld": True, "chosen": False, "choice": "only",
            "choice_text": "No phone was chosen as the one in the car. The only phone is used.",
            "lat_deg": 32.231828, "lon_deg": -110.95005, "accuracy_m": 5.0,
            "sigma_m": 3.3, "alt_m": None, "speed_mps": None, "heading_deg": None, "at_ms": 0,
            "age_s": 0.8, "used": True, "why": None, "why_text": None, "apart_m": 10.4, "bearing_deg": 323.6,
            "compared_age_s": 0.8, "explained_m": 14.0, "correlation": None,
        },
    }  # fmt: skip


def slow(state: str, **more: Any) -> Json:
    """How the slow-down stands."""
    return {
        "state": state, "why": None, "topic": "/catvehicle/cmd_vel", "type": "geometry_msgs/Twist", "rivals": [],
        "armed_by": None if state in ("not_available", "not_armed") else "Pixel 7", "deceleration_mps2": 1.5,
        "order": None, "countdown": None, "guard": None, **more,
    }  # fmt: skip


def slowed(confirmed: bool | None = True, **more: Any) -> Json:
    """An order of 1.3 s ago as it stands, where it was executed: each step later than the one before."""
    begun_ms = _now_ms() - 1300
    slows_ms = begun_ms + 420 if confirmed else None
    steps = {"pressed_ms": begun_ms, "server_ms": begun_ms + 20, "bridge_ms": begun_ms + 30, "slows_ms": slows_ms}
    order = {
        "number": 3, "by": "Pixel 7", "why": "by hand", "for_s": 1.3, "from_mps": 4.2, "ordered_mps": 2.2,
        "deceleration_mps2": 1.5, "sending": True, "confirmed": confirmed, "stands": None, "steps": steps,
        "longest_s": 600.0, **more,
    }  # fmt: skip
    return slow("ordered", order=order)


def idle(phase: str = "idle") -> Json:
    """Before a car is connected."""
    state = live()
    state["session"] |= {"phase": phase, "address": None, "name": None, "connected_for_s": None}
    state["signals"] = {
        name: one | {"freshness": "not_published", "value": None, "age_s": None}
        for name, one in state["signals"].items()
    }
    state["checks"] = []
    return state


def alarm(name: str, title: str, **more: Any) -> Json:
    """A standing alarm."""
    return {
        "id": name, "occurrence": 1, "title": title, "priority": "warning", "place": "snackbar", "sound": "medium",
        "state": "UNACKED", "active": True, "needs_ack": False, "raised_ms": 0, "for_s": 2.3, "verdict": "fault",
        "text": "", "trip_text": "", "measured": None, "limit": None, "worst": None, "causes": [],
        "actions": ["shelve", "acknowledge"], "advice": "", "acknowledged_by": None, "shelved_until_ms": None,
        "shelved_by": None, "silenced_until_ms": None, "silenced_by": None, **more,
    }  # fmt: skip


def check(name: str, label: str, **more: Any) -> Json:
    """The answer to a request for one check: OK, and nothing measured."""
    return {
        "id": name, "label": label, "tile": label,
        "checks": [{"id": name, "label": label, "verdict": "ok", "text": "", "priority": "warning"}],
        "verdict": "ok", "text": "OK", "for_s": 41.0, "measured": None, "limit": None,
        "checked_when": "Always checked.", "settings": [], "title": label, "priority": "warning",
        "delays": {"on_s": 0.3, "off_s": 2.0}, "ends": None, "advice": "",
        "suppressed_by": [], "signal": None, "minute": {"step_s": 0.2, "values": [], "limits": []}, **more,
    }  # fmt: skip


# Metres east and north of the car and seconds: the way the pictures of the design show.
WAY = (
    (-20.3, -25.7, 0),
    (-22.4, -16.2, 10),
    (-22.2, -8.1, 14),
    (-20.3, -3.5, 16),
    (-16.2, -1.1, 20),
    (-9.5, -0.3, 24),
    (-4, -0.1, 27),
)


def track() -> list[list[float]]:
    """The rows of GET /api/track/points."""
    return [
        [n, 32.231904 + north / 110_890, -110.950116 + east / 94_274, float(at_s), 0]
        for n, (east, north, at_s) in enumerate(WAY, 1)
    ]


def scan(number: int) -> bytes:
    """A wall on the left, a parked car on the right, a person ahead and one blind sector; 181 beams."""
    beams = [_cast(math.radians(i - 90), i) for i in range(181)]
    scale = 81.0 / 65000
    codes = [0 if r is None else 65534 if r > 79 else round(r / scale) for r in beams]
    degree = math.radians(1)
    header = struct.pack("<BBHIHHffffbBH", 0x53, 2, 181, number, 10, 710, -math.pi / 2, degree, 81.0, 12.4, 0, 0, 87)
    return header + struct.pack(f"<{len(codes)}H", *codes)


def _cast(angle: float, index: int) -> float | None:
    if -72 < math.degrees(angle) < -54.5:
        return None
    x, y = math.cos(angle), math.sin(angle)
    best = 81.0
    for ax, ay, bx, by in _walls():
        dx, dy = bx - ax, by - ay
        det = x * dy - y * dx
        if abs(det) < 1e-9:
            continue
        t, u = (ax * dy - ay * dx) / det, (ax * y - ay * x) / det
        if t > 0 and 0 <= u <= 1:
            best = min(best, t)
    noise = math.sin(index * 12.9898) * 43758.5453
    return best + ((noise - math.floor(noise)) - 0.5) * 0.06 if best <= 79 else best


def _walls() -> list[tuple[float, float, float, float]]:
    def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
        return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]

    return [
        (-2, 5.6, 40, 6.2), *box(6.9, -5.0, 11.3, -3.1), *box(12.38, -0.98, 12.9, -0.42), (19.2, -14, 18.4, -6),
        (17.4, 6, 17.4, 2.1), (60, 40, 60, -60), (60, -30, -2, -30),
    ]  # fmt: skip


def trends(now: float, begin: int, steps: int) -> Json:
    """The last minute of a drive that speeds up and slows down, the distance unknown for 5 s of it."""
    first = int(now) - steps

    def at(name: str, n: int) -> float | None:
        t = (n - begin) / 5
        noise = math.sin(7.1 * t) * 0.6 + math.sin(3.3 * t) * 0.4
        return {
            "speed": 3.6 + 0.8 * math.sin(t / 9) + 0.12 * noise,
            "acceleration": 0.3 + 0.25 * noise,
            "distance": None if -24 < t < -19 else 12.4 + 2.2 * math.sin(t / 7) + 0.2 * noise,
            "steering": -4 + 3.0 * math.sin(t / 11) + 0.7 * noise,
            "brake": max(0.0, -30 * math.sin(t / 9 + 2) - 12),
            "accelerator": max(0.0, 14 + 9 * math.sin(t / 6)),
        }[name]

    rows = {
        name: [at(name, n) for n in range(first, int(now))]
        for name in ("speed", "acceleration", "distance", "steering", "brake", "accelerator")
    }
    highest = {name: [None if v is None else v + 0.05 for v in row] for name, row in rows.items()}
    return {"step_s": 0.2, "since": 0, "first": first, "now": now, "lowest": rows, "highest": highest}


def drives() -> list[Json]:
    """Rows of GET /api/recordings: what a week of drives leaves behind."""
    north = [(-1) ** n * 3.0 + 7 * n for n in range(14)]
    listed = [
        (4.4, 768.0, 57.1, {"critical": 1, "warning": 2, "advisory": 0}, ""),
        (22.7, 1865.0, 138.0, {"critical": 0, "warning": 1, "advisory": 3}, ""),
        (49.0, 512.0, 38.0, {"critical": 2, "warning": 0, "advisory": 0}, ""),
        (53.9, 1337.0, 99.4, {"critical": 0, "warning": 0, "advisory": 0}, "Rehearsal lot"),
        (95.2, 221.0, 16.2, {"critical": 0, "warning": 0, "advisory": 0}, ""),
        (123.6, 1082.0, 80.3, None, ""),
    ]
    rows = []
    for n, (ago_h, length_s, megabytes, alarms, title) in enumerate(listed):
        places = [(y * math.cos(n + i / 9) / 1e5, y * math.sin(n + i / 9) / 1e5) for i, y in enumerate(north)]
        way = [
            TrackPoint(at_s=float(i), lat_deg=lat, lon_deg=lon, distance_m=0.0) for i, (lat, lon) in enumerate(places)
        ]
        counts = alarms or {}
        marks = [(4.0 + 4 * i, kind) for kind in ("critical", "warning") for i in range(counts.get(kind, 0))]
        drawn = sketch(way, marks) if n != 4 else None
        rows.append(
            {
                "id": f"car_{n}", "vehicle": "CATVehicle", "session": None, "part": 1, "length_s": length_s,
                "started_ms": _now_ms() - round(ago_h * 3_600_000), "size_bytes": round(megabytes * 1e6),
                "distance_m": 2.4 * length_s, "top_speed_mps": 12.6, "alarms": alarms, "title": title, "note": "",
                "tags": ["wet"] if title else [], "state": "read", "problem": None, "damage": [],
                "ended": "recovered" if n == 2 else "closed", "ended_why": None, "is_clip": False, "clip_of": None,
                "file": f"car_{n}.mcap", "format": "bag" if alarms is None else "mcap", "sha256": None,
                "thumbnail": "", "sketch": drawn.as_json() if drawn else None, "trashed_ms": None,
            }
        )  # fmt: skip
    return rows


class Canned:
    """The server: `state` is what every page gets from now on, `silent` makes it hold its tongue."""

    def __init__(self) -> None:
        self.reset()
        self.address = ""
        self.app = FastAPI()
        self._watching = False
        self._page: str | None = None
        files = PageFiles(static_dir(), Jinja2Templates(directory=templates_dir()))
        self.app.mount("/static", StaticText(directory=files.static))

        @self.app.get("/")
        def page(request: Request) -> Response:
            built = find(files.static)
            context = {"version": "0.1.0", "vehicle": self.vehicle, "access": self.access, "has_store": True}
            return files.response(files.render("page.html", request, built, **context), request, built)

        @self.app.get("/fleet")
        def fleet(request: Request) -> Response:
            built = find(files.static)
            context = {"version": "0.1.0", "access": self.access}
            return files.response(files.render("fleet.html", request, built, **context), request, built)

        @self.app.post("/api/ticket")
        async def ticket(response: Response) -> Json:
            response.status_code = 401
            return {"code": "unknown", "detail": "This device is not paired."}

        @self.app.get("/api/vehicles")
        async def vehicles() -> Json:
            return {"vehicles": [], "found": self.found}

        @self.app.get("/api/settings")
        async def settings() -> Json:
            return cast(Json, ActiveSettings(SettingsFile(None)).as_json()) | self.settings

        @self.app.get("/api/signals")
        async def signals() -> Json:
            known = [one for one in self.state["signals"].values() if one["topic"] and one["type"]]
            offered = {one["topic"]: one["type"] for one in known}
            found = candidates(offered) | self.candidates
            return {"candidates": found, "topics": [{"topic": "/rosout", "type": "rosgraph_msgs/Log"}]}

        @self.app.get("/api/checks/{name}")
        async def one_check(name: str, response: Response) -> Json:
            if name not in self.checks:
                response.status_code = 409
                return {"detail": "There is no such check."}
            return self.checks[name]

        @self.app.get("/api/log")
        async def log() -> Json:
            return {"events": self.log, "next_before": None}

        @self.app.get("/api/map")
        async def ground() -> Json:
            return self.ground

        @self.app.get("/map/{z}/{x}/{y}")
        async def tile(z: int, x: int, y: int) -> Response:
            return Response(self.tile(z, x, y), media_type="image/png")

        @self.app.get("/api/track/points")
        async def points(after: int = 0) -> Json:
            return {"number": 1, "points": [row for row in track() if row[0] > after]}

        @self.app.get("/api/recordings")
        async def recordings(text: str = "") -> Json:
            kept = {"count": 27, "bytes": 1_900_000_000}
            more = {"trash": {"count": 2, "bytes": 81_000_000}, "free_bytes": 41_000_000_000, "waiting": 0}
            names = {"vehicles": ["car"], "tags": ["wet"], "formats": listed_formats()}
            rows = drives()
            if text:  # each is found by a mark of it
                words = "Steering hunts at the stop line, twice in a row, and the car then creeps."
                mark = {"mark": "m1", "marked_ms": 0, "at_s": 246.2, "category": text, "words": words}
                rows = [row | {"matched": mark} for row in rows]
            return {"recordings": rows, "next": None, "found": kept, "all": kept} | more | names

        @self.app.get("/api/recordings/{name}")
        async def recording(name: str) -> Json:
            row = next(one for one in drives() if one["id"] == name)
            raised = (
                (102, "warning", "GPS drift at standstill", "6.3 m, 2.0 m are allowed"),
                (256, "critical", "Speed above limit", "12.1 m/s, limit 11.0 m/s"),
                (378, "warning", "Phone position missing", "none for 16 s"),
            )
            return row | {
                "raised": [
                    {"at_ms": row["started_ms"] + 1000 * at_s, "alarm": title, "title": title, "priority": priority,
                     "text": text, "occurrence": 1}
                    for at_s, priority, title, text in raised
                ]
            }  # fmt: skip

        @self.app.get("/api/recordings/{name}/marks")
        async def recorded_marks(name: str) -> Json:
            return {"marks": self.marks}

        @self.app.get("/api/devices")
        async def devices() -> Json:
            return {"you": "local", "open": True, "devices": []}

        @self.app.get("/api/marks")
        async def drive_marks() -> Json:
            return {"marks": self.drive_marks}

        @self.app.get("/api/interventions/{name}")
        async def intervention(name: str) -> Json:
            return self.interventions[name]

        @self.app.get("/api/people")
        async def people() -> Json:
            people = People(None, wall_ms=lambda: 0)
            people.board.add("ak", "A. K.", "operator", 0)
            return cast(Json, people.listed(None))

        @self.app.get("/api/departure")
        async def departure() -> Json:
            active = ActiveSettings(SettingsFile(None))
            return cast(Json, CarDeparture(active, DepartureFile(None), lambda *_, **__: None).answer())

        @self.app.get("/api/mail/settings")
        async def mail_settings() -> Json:
            return {"is_complete": True, "limit_mb": 18}

        @self.app.get("/api/mail")
        async def mails() -> Json:
            return {"mails": self.mails, "next": None, "trouble": None}

        @self.app.get("/api/trends")
        async def minute() -> Json:
            return self._trends(299)

        @self.app.get("/api/trends/drive")
        async def drive(request: Request) -> Any:
            return self.drive.answer(dict(request.query_params))

        @self.app.websocket("/ws")
        async def socket(socket: WebSocket) -> None:
            await socket.accept()
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await self._serve(socket, is_fleet="fleet" in socket.query_params)

    def reset(self) -> None:
        """As it is at first: a calm drive."""
        self.state = live()
        self.silent = False
        self.is_scanning = True
        self.received: list[Json] = []
        self.refuses: dict[str, str] = {}  # why, by the kind of command
        self.role = "operator"
        self.duty: Json | None = None  # who is on duty at the page's device
        self.found: list[Json] = [
            {"name": "CATVehicle", "address": "ws://192.168.4.1:9090"},
            {"name": "Simulated car", "address": "ws://127.0.0.1:9091"},
        ]
        self.ground: Json = {"layers": [], "image": None}
        self.log: list[Json] = []  # newest first
        self.candidates: dict[str, list[Json]] = {}  # of a signal, in the place of those by type
        self.settings: Json = {}  # what differs of `GET /api/settings`
        self.checks: dict[str, Json] = {}  # the answer for each check that is requested by its id
        self.timeline: Json | None = None  # of the recording that a page requests to replay
        self.mails: list[Json] = []
        self.marks: list[Json] = []  # of every recording
        self.drive_marks: list[Json] = []  # of the drive that goes on
        self.interventions: dict[str, Json] = {}  # by their id
        self.vehicle = "car"
        self.access = "open"
        self.cars_every_s = 0.5
        self.states_every_s = 0.1
        self.answers_after_s = 0.0  # to a take
        self.floods = False  # each take is answered with another offer, at once
        self.fleet_events: list[Json] = []
        self.cars: list[Json] = []  # summaries of all cars, by their name
        self.tile: Callable[[int, int, int], bytes] = lambda z, x, y: b""
        self.drive = CannedDrive()
        begin = int(time.monotonic() * 5)
        self._trends = lambda steps: trends(time.monotonic() * 5, begin, steps)

    async def _serve(self, socket: WebSocket, *, is_fleet: bool) -> None:
        names = [one["name"] for one in self.cars] or [self.vehicle]
        hello = {"kind": "hello", "version": "0.1.0", "boot": "9f00", "vehicles": names}
        hello["vehicle"] = "" if is_fleet else self.vehicle
        who = {"id": "local", "name": "Pixel 7", "role": self.role}
        more = {"build": "", "time_ms": _now_ms(), "last_event": 117, "veil_after_s": 2.0, "who": who}
        await socket.send_json(hello | more)
        for event in self.fleet_events if is_fleet else ():
            await socket.send_json({"kind": "fleet_event"} | event)
        beat = asyncio.create_task(self._fleet_beat(socket) if is_fleet else self._beat(socket))
        try:
            while True:
                message = await socket.receive_json()
                self.received.append(message)
                if message.get("kind") == "watch":
                    self._watching = message["scan"]
                if message.get("kind") == "take" and self.floods:
                    await socket.send_json({"kind": "offer", "seq": message["seq"], "of": ["scan"]})
                if message.get("kind") == "hello":
                    self._page = message.get("page")
                    if self.duty is not None:
                        await socket.send_json(self.duty)
                    if self.log and not is_fleet:
                        await socket.send_json({"kind": "events", "events": self.log[::-1], "last": self.log[0]["n"]})
                if "id" in message:
                    why = self.refuses.get(message["kind"])
                    reply = {"kind": "reply", "id": message["id"], "ok": why is None}
                    await socket.send_json(reply | ({"reason": why} if why else {}))
                if message.get("kind") == "replay" and self.timeline is not None:
                    await socket.send_json(self.timeline)
        finally:
            beat.cancel()

    async def _fleet_beat(self, socket: WebSocket) -> None:
        while True:
            if not self.silent:
                for one in self.cars:
                    if one["summary"]:
                        one["summary"]["time_ms"] = _now_ms()
                await socket.send_json({"kind": "cars", "time_ms": _now_ms(), "cars": self.cars})
            await asyncio.sleep(self.cars_every_s)

    async def _beat(self, socket: WebSocket) -> None:
        number = 0
        while True:
            if not self.silent:
                number += 1
                state = copy.deepcopy(self.state)
                state["server"]["time_ms"] = _now_ms()
                state["trends"] = self._trends(4)
                if state["control"]["holder"] == "You":
                    state["control"] |= {"page": self._page, "fence": 1}
                await socket.send_json({"kind": "offer", "seq": number, "of": ["state"]})
                await asyncio.sleep(self.answers_after_s)
                await socket.send_json(state | {"vehicle": self.vehicle})
                if self.cars:
                    await socket.send_json({"kind": "cars", "time_ms": _now_ms(), "cars": self.cars})
                if self._watching and self.is_scanning:
                    await socket.send_bytes(scan(number))
            await asyncio.sleep(self.states_every_s)

    @contextlib.asynccontextmanager
    async def running(self) -> Any:
        """Serves while the block runs; gives the address."""
        server = uvicorn.Server(uvicorn.Config(self.app, port=0, log_level="warning", ws=PageSocket))
        task = asyncio.create_task(server.serve())
        while not server.started:  # uvicorn has no event for it
            await asyncio.sleep(0.02)
        try:
            self.address = f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
            yield self.address
        finally:
            server.should_exit = True
            await task


def _now_ms() -> int:
    return time.time_ns() // 1_000_000
