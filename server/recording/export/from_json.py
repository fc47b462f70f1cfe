"""Messages of a ROS type that were recorded as JSON, in the encoding of their ROS: bags have no other."""

from __future__ import annotations

from collections.abc import Callable

import orjson

from server.recording.read.definitions import definitions_of, times
from server.recording.read.encode import TypeMismatch, compile_encoder
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel, FileSource


def encoder_of_json(channel: Channel, source: FileSource) -> Callable[[bytes], bytes]:
    """Return the function from a message in JSON to one of the file's version of ROS.

    Raises Undecodable where the type is not known, and from the function where a message does not match it.
    """
    definitions = definitions_of(channel, source.ros_version, source.distro)
    if channel.type not in definitions:
        raise Undecodable("it was recorded as JSON, and the definition of its type is unknown")
    if source.ros_version == 2:
        definitions = {**times(), **definitions}
    encode = compile_encoder(channel.type, definitions, source.ros_version)

    def encoded(raw: bytes) -> bytes:
        try:
            return encode(orjson.loads(raw))
        except (TypeMismatch, ValueError):
            raise Undecodable("it was recorded as JSON that does not match its type") from None

    return encoded
