"""What describes a field of a frame: its meaning and unit stand beside its type, and in docs/protocol.md."""

from __future__ import annotations

from pydantic import Field
from pydantic.fields import FieldInfo


def doc(text: str) -> FieldInfo:
    """The description of a field, for `Annotated`."""
    described: FieldInfo = Field(description=text)
    return described
