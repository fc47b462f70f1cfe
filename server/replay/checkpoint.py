"""Keeps what a run knew at a moment as bytes, so that it can go on from there as often as somebody wants."""

from __future__ import annotations

import io
import pickle
import zlib
from types import MappingProxyType
from typing import Any, cast

from monitor.catalog import CHECKS
from server.judge.run_state import RunState

_BY_ID = {check.id: check for check in CHECKS}
_IDS = {id(check): check.id for check in CHECKS}


def save(run_state: RunState) -> bytes:
    """A copy that later steps do not change; some 20 kB."""
    out = io.BytesIO()
    _Packer(out, protocol=5).dump(run_state)
    return zlib.compress(out.getvalue(), 1)


def restore(saved: bytes) -> RunState:
    """Restore the state of a run, a new object each time. Only for bytes that this process saved."""
    return cast(RunState, _Unpacker(io.BytesIO(zlib.decompress(saved))).load())


class _Packer(pickle.Pickler):
    def persistent_id(self, obj: Any) -> str | None:
        """Checks are no part of what is known: there is one of each."""
        return _IDS.get(id(obj))

    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is MappingProxyType:
            return (_view, (dict(obj),))
        return NotImplemented


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> Any:
        return _BY_ID[pid]


def _view(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(mapping)
