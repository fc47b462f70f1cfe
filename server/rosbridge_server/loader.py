"""Message types by name, with the errors of rosbridge's loader."""

from __future__ import annotations

from server.judge.ros_names import BadName, canonical_type
from server.rosbridge_server.interface import TypeSource


class Malformed(Exception):
    """No name of a type."""


class Unknown(Exception):
    """A package or a type that is not installed."""


def load(bridge: TypeSource, name: str) -> str:
    """The type as the graph has it. Raises Malformed and Unknown, with the texts of rosbridge."""
    try:
        type = canonical_type(name, bridge.ros_version)
    except BadName:
        raise Malformed(f"{name} is not a valid type string") from None
    if bridge.types.definitions(type) is None and type not in bridge.advertised_types():
        package, kind = name.partition("/")[0], name.rpartition("/")[2]
        if not bridge.types.has_package(package):
            raise Unknown(f"Unable to load the manifest for package {package}. Caused by: {package}")
        raise Unknown(
            f"Unable to import msg class {kind} from package {package}. "
            f"Caused by module '{package}.msg' has no attribute '{kind}'"
        )
    return type
