"""Makes frozen values quickly, where they are made thousands of times a second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, fields, make_dataclass
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")


def maker(cls: Callable[P, T]) -> Callable[P, T]:
    """A function that makes instances of a frozen, slotted, keyword-only dataclass, at less than half the usual cost.

    A frozen dataclass sets each of its fields through `object.__setattr__`. Here an open twin with the same slots is
    filled in the ordinary way and then becomes `cls`, as frozen as any other. Not for classes with `__post_init__`.
    """
    kind: Any = cls

    def become(self: Any) -> None:
        self.__class__ = kind

    twin = make_dataclass(
        kind.__name__,
        [(one.name, Any, field(default=one.default, default_factory=one.default_factory)) for one in fields(kind)],
        bases=getattr(kind, "__orig_bases__", kind.__bases__),
        namespace={"__post_init__": become},
        slots=True,
        kw_only=True,
        repr=False,
        eq=False,
    )
    return cast("Callable[P, T]", twin)
