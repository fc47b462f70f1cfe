"""Uploads the recordings of a server into its store, one after the other, in a thread of its own at low priority."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sqlite3
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

from server.protocol.answers import Recording, StoredCopy, StoreFacts
from server.recording.catalog.catalog import Catalog
from server.recording.catalog.discovery import why_not_one_file
from server.recording.catalog.entries import NotThere, Refused
from server.recording.folder import FOLDER
from server.recording.store.clips import ClipMaker
from server.recording.store.copying import ANOTHER, Copying, FileChanged, NotTheSame
from server.recording.store.object_store import ObjectStore, Pace
from server.recording.store.plan import Job, Plan, backoff_ms, is_another, is_deletion_due
from server.recording.store.rules import Situation, WholeFiles, is_interface_up, why_not_whole
from server.recording.store.trouble import StoreTrouble
from server.recording.store.uploads import Failure, Upload, Uploads
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.store")

LOOK_S = 10.0  # between two looks at the list of recordings, if nothing is requested
SOON_S = 1.0  # while recordings are being read, or the store is away
OBSERVE_S = 1.0
_STOPS_WITHIN_S = 3.0
_NICENESS = 15


class Halted(Exception):
    """Work ends here: the server stops, or the rule does not hold any more."""


class Uploader:
    """`ask`, `withdraw`, `copy_of` and `facts` may be called from any thread but the event loop's: they read a disk."""

    def __init__(
        self,
        store: ObjectStore,
        uploads: Uploads,
        catalog: Catalog,
        situations: Callable[[], Mapping[str, Situation]],
        *,
        clips: Path,
        interface: str | None = None,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        look_s: float = LOOK_S,
    ) -> None:
        """`situations()` by vehicle is called on the event loop; `interface`: up means that the car is in the depot."""
        self.store = store
        self._uploads = uploads
        self._catalog = catalog
        self._observe = situations
        self._interface = interface
        self._now = now
        self._wall_ms = wall_ms
        self._look_s = look_s
        self._situations: Mapping[str, Situation] = {}
        self._job: Job | None = None
        self._done: tuple[str, str] | None = None  # the newest step
        self._share: float | None = None
        self._trouble: Failure | None = None  # of the store as a whole
        self._is_stopping = threading.Event()
        self._wake = threading.Event()
        self._plan = Plan(catalog, uploads, self._situation, self._why_not, wall_ms=wall_ms)
        maker = ClipMaker(clips, self._may_go_on)
        self._copying = Copying(store=store, uploads=uploads, catalog=catalog, clips=maker, wall_ms=wall_ms)
        self._thread = threading.Thread(target=self._work, name="catgraph-store", daemon=True)
        self._supervisor = Supervisor("store")

    # -- its life ------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        self._situations = dict(self._observe())
        self._supervisor.keep("observing the cars", self._keep_observing)
        self._thread.start()

    async def stop(self) -> None:
        """What is being sent is broken off, and sent again at the next start."""
        self._is_stopping.set()
        self._wake.set()
        await self._supervisor.stop()
        if self._thread.ident is not None:
            await asyncio.to_thread(self._thread.join, _STOPS_WITHIN_S)
        if not self._thread.is_alive():
            await asyncio.to_thread(self._uploads.close)

    def rouse(self) -> None:
        """There may be something to do."""
        self._wake.set()

    async def _keep_observing(self) -> None:
        while True:
            self._situations = dict(self._observe())
            await asyncio.sleep(OBSERVE_S)

    # -- what people see and ask for -----------------------------------------------------------------------------------

    def ask(self, id: str, *, deletes: bool) -> None:
        """The whole file is wanted in the store, and with `deletes` no longer here once the copy is verified.

        Raises NotThere, Refused.
        """
        row = self._catalog.row(id)
        if row is None:
            raise NotThere("There is no such recording.")
        if self._situation(row).rule.whole is WholeFiles.NEVER:
            raise Refused("Whole files are not uploaded: see Settings, Store.")
        if is_another(row, self._uploads.get(id)):
            raise Refused(ANOTHER)
        self._change(id, lambda upload: _note_request(upload, deletes=deletes))
        self._trouble = None  # a request is tried now
        self.rouse()

    def withdraw(self, id: str) -> None:
        """The whole file is not requested any more, nor its deletion here. Raises Refused."""
        self._change(id, _forget_request)
        self.rouse()

    def _change(self, id: str, note: Callable[[Upload], None]) -> None:
        try:
            self._uploads.change(id, note)
        except sqlite3.Error as why:
            raise Refused(f"It cannot be kept: {why}.") from None

    def facts(self) -> StoreFacts:
        """The store, and what is wrong with it."""
        trouble = self._trouble
        return {"address": self.store.address.text, "problem": None if trouble is None else trouble.sentence}

    def copy_of(self, row: Recording) -> StoredCopy:
        """What the store has of a recording."""
        upload, job, share = self._uploads.get(row["id"]), self._job, self._share
        state, sentence = self._state(row, upload)
        if is_another(row, upload):
            upload = Upload(id=upload.id)  # nothing of this one
        checked_ms = upload.verified.at_ms if upload.verified is not None else None
        if job is not None and job.id == row["id"] and job.kind == "file" and share is not None:
            state, sentence = "uploading", ""
        return {
            "state": state,
            "share": round(share, 3) if state == "uploading" and share is not None else None,
            "checked_ms": checked_ms if state == "stored" else None,
            "sentence": sentence,
            "clips": len(upload.clips),
            "is_asked": upload.is_deletion_asked or (upload.is_asked and state != "stored"),
            "is_deletion_asked": is_deletion_due(self._situation(row).rule, upload),
        }

    def _state(
        self, row: Recording, upload: Upload
    ) -> tuple[Literal["none", "waiting", "uploading", "stored", "failed"], str]:
        if is_another(row, upload):
            return ("waiting", "") if row["state"] == "waiting" else ("failed", ANOTHER)
        trouble = upload.failure or self._trouble
        if self._plan.is_stored(row, upload):
            return "stored", upload.failure.sentence if upload.failure is not None else ""
        why_not = self._why_not(row, upload)
        if upload.failure is not None or (trouble is not None and why_not is None):
            return "failed", trouble.sentence if trouble is not None else ""
        return ("none", why_not) if why_not is not None else ("waiting", "")

    def problems(self) -> list[str]:
        """What is wrong with its tasks, a sentence each."""
        return self._supervisor.problems()

    # -- the thread ----------------------------------------------------------------------------------------------------

    def _situation(self, row: Recording) -> Situation:
        return self._situations.get(row["vehicle"], Situation())

    def _why_not(self, row: Recording, upload: Upload) -> str | None:
        """Why its file is not sent now. A clip is a recording that a person cut out, and is sent as such."""
        if row["format"] in (FOLDER, "db3") and (path := self._catalog.path(row["id"])) is not None:
            if (what := why_not_one_file(path)) is not None:
                return f"{what.capitalize()} is not uploaded."
        is_asked = upload.is_asked or row["is_clip"]
        is_up = is_interface_up(self._interface)
        return why_not_whole(self._situation(row), is_asked=is_asked, is_on_depot_network=is_up)

    def _work(self) -> None:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)  # of this thread only, on Linux
        while not self._is_stopping.is_set():
            self._wake.clear()
            try:
                job = None if self._is_paused() else self._plan.next()
                if job is not None:
                    if self._done == (job.kind, job.id):  # a step that changes nothing must not be all that is done
                        self._wake.wait(SOON_S)
                    self._done = (job.kind, job.id)
                    self._do(job)
                    continue
            except Exception:  # whatever a disk does, the next round finds an uploader at work
                log.exception("upload_round_failed")
            is_soon = self._trouble is not None or self._catalog.waiting
            self._wake.wait(min(self._look_s, SOON_S) if is_soon else self._look_s)

    def _is_paused(self) -> bool:
        return self._trouble is not None and self._wall_ms() < self._trouble.next_ms

    def _do(self, job: Job) -> None:
        self._job = job
        try:
            self._step(job)
            self._trouble = None
            if self._uploads.get(job.id).failure is not None:
                self._uploads.change(job.id, lambda upload: setattr(upload, "failure", None))
        except Halted:
            return
        except StoreTrouble as why:
            if why.is_general:
                tries = self._trouble.tries + 1 if self._trouble is not None else 1
                next_ms = self._wall_ms() + backoff_ms(tries)
                self._trouble = Failure(sentence=str(why), tries=tries, next_ms=next_ms)
                log.warning("store_failed kind=%s tries=%d why=%s", why.kind, tries, why)
            else:
                self._failed(job, str(why))
        except (NotTheSame, FileChanged, Refused, NotThere) as why:
            self._failed(job, str(why))
        except (OSError, sqlite3.Error) as why:
            self._failed(job, f"It cannot be read or kept here: {getattr(why, 'strerror', None) or why}.")
        except Exception:
            log.exception("upload_failed recording=%s step=%s", job.id, job.kind)
            self._failed(job, "Internal error; the server's log has the details.")
        finally:
            self._job = self._share = None

    def _step(self, job: Job) -> None:
        copying = self._copying
        match job.kind:
            case "row":
                copying.send_row(job.id)
            case "clips":
                copying.send_clips(job.id, self._pace(job))
            case "file":
                self._share = 0.0
                copying.send_file(job.id, self._pace(job), self._note_share)
                log.info("recording_stored recording=%s", job.id)
            case "delete":
                copying.delete_here(job.id, self._pace(job))
                log.info("recording_deleted_after_upload recording=%s", job.id)

    def _note_share(self, share: float) -> None:
        self._share = share

    def _failed(self, job: Job, sentence: str) -> None:
        log.warning("upload_failed recording=%s step=%s why=%s", job.id, job.kind, sentence)

        def note(upload: Upload) -> None:
            tries = upload.failure.tries + 1 if upload.failure is not None else 1
            upload.failure = Failure(sentence=sentence, tries=tries, next_ms=self._wall_ms() + backoff_ms(tries))

        try:
            self._uploads.change(job.id, note)
        except sqlite3.Error as why:
            log.exception("upload_state_not_kept recording=%s", job.id)
            self._trouble = Failure(
                sentence=f"The state of the uploads cannot be kept: {why}.",
                tries=1,
                next_ms=self._wall_ms() + backoff_ms(3),
            )

    def _pace(self, job: Job) -> Pace:
        def may_go_on() -> None:
            self._may_go_on()
            if job.kind == "file" and self._why_not(job.row, self._uploads.get(job.id)) is not None:
                raise Halted
            if job.kind == "delete" and not is_deletion_due(self._situation(job.row).rule, self._uploads.get(job.id)):
                raise Halted

        return Pace(
            lambda: self._situation(job.row).rule.bytes_per_s,
            may_go_on,
            now=self._now,
            sleep=self._is_stopping.wait,
        )

    def _may_go_on(self) -> None:
        if self._is_stopping.is_set():
            raise Halted


def _note_request(upload: Upload, *, deletes: bool) -> None:
    upload.is_asked, upload.failure = True, None
    upload.is_deletion_asked = upload.is_deletion_asked or deletes


def _forget_request(upload: Upload) -> None:
    upload.is_asked = upload.is_deletion_asked = False
