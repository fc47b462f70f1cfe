"""The mutants of the judged packages: each is one small change, made by the operators of mutmut.

Inside a function every operator is applied; of what a module declares only the numbers of its constants are changed.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import libcst as cst
from libcst.metadata import MetadataWrapper, ParentNodeProvider, PositionProvider
from mutmut.mutation.mutators import mutation_operators, operator_number

from tests.tree import PROJECT

MUTATED = (
    "monitor/**/*.py",
    "server/control/*.py",
    "server/slowdown/order.py",
    "server/slowdown/order_log.py",
    "server/slowdown/countdown.py",
)
LEFT_OUT_CALLS = ("len", "isinstance")  # None in place of their arguments is a TypeError wherever it is called
LEAST_PER_MODULE = 20


@dataclass(frozen=True)
class Mutant:
    """One change. `line` and `end_line` hold the node that is changed."""

    path: str
    function: str  # qualified name within the module; of a constant its name
    line: int
    end_line: int
    number: int  # among the mutants of the file
    is_text: bool  # it changes only a text that a person reads
    in_signature: bool
    is_constant: bool

    @property
    def id(self) -> str:
        return f"{self.path}:{self.line}:{self.number}"


@dataclass
class MutatedFile:
    path: str
    module: cst.Module
    mutants: list[Mutant]
    nodes: list[tuple[cst.CSTNode, cst.CSTNode, cst.CSTNode]]  # before, after, and what shows the place

    def change(self, mutant: Mutant) -> str:
        """What is changed into what, on one line."""
        _, after, shown = self.nodes[mutant.number]
        before, after_it = (" ".join(cst.Module(body=[]).code_for_node(node).split()) for node in (shown, after))
        return f"{before} → {after_it}"

    def source(self, mutant: Mutant) -> str:
        """The text of the whole file with one change."""
        before, after, _ = self.nodes[mutant.number]
        return self.module.visit(_Replacement(before, after)).code  # type: ignore[union-attr]


class _Replacement(cst.CSTTransformer):
    def __init__(self, before: cst.CSTNode, after: cst.CSTNode) -> None:
        self._before, self._after = before, after

    def on_leave(self, original_node: cst.CSTNode, updated_node: cst.CSTNode) -> cst.CSTNode:  # type: ignore[override]
        return self._after if original_node is self._before else updated_node


class _Collector(cst.CSTVisitor):
    METADATA_DEPENDENCIES = (PositionProvider, ParentNodeProvider)

    def __init__(self, path: str) -> None:
        super().__init__()
        self._path = path
        self._scope: list[cst.FunctionDef | cst.ClassDef] = []
        self._signatures = 0
        self._constant = ""
        self.found: list[tuple[Mutant, tuple[cst.CSTNode, cst.CSTNode, cst.CSTNode]]] = []

    def on_visit(self, node: cst.CSTNode) -> bool:
        if isinstance(node, cst.Annotation | cst.Decorator):
            return False
        if isinstance(node, cst.Call) and isinstance(node.func, cst.Name) and node.func.value in LEFT_OUT_CALLS:
            return False
        if isinstance(node, cst.FunctionDef | cst.ClassDef):
            self._scope.append(node)
        elif any(isinstance(scope, cst.FunctionDef) for scope in self._scope):
            self._signatures += isinstance(node, cst.Parameters)
            self._mutate(node)
        elif not self._scope and isinstance(node, cst.Assign):
            target, value = node.targets[0].target, node.value
            is_number = isinstance(value, cst.BaseNumber | cst.UnaryOperation | cst.BinaryOperation)
            self._constant = target.value if isinstance(target, cst.Name) and is_number else ""
        elif not self._scope and self._constant and isinstance(node, cst.BaseNumber):
            for after in operator_number(node):
                self._add(node, after)
        return True

    def on_leave(self, original_node: cst.CSTNode) -> None:
        if isinstance(original_node, cst.FunctionDef | cst.ClassDef):
            self._scope.pop()
        elif isinstance(original_node, cst.Parameters) and self._scope:
            self._signatures -= 1
        elif isinstance(original_node, cst.Assign):
            self._constant = ""

    def _mutate(self, node: cst.CSTNode) -> None:
        for kind, operator in mutation_operators:
            if isinstance(node, kind):
                for after in operator(node):
                    self._add(node, after)

    def _add(self, before: cst.CSTNode, after: cst.CSTNode) -> None:
        where = self.get_metadata(PositionProvider, before, None)
        shown: cst.CSTNode = before
        if where is None:  # an operator such as `is`
            shown = self.get_metadata(ParentNodeProvider, before)
            where = self.get_metadata(PositionProvider, shown)
        names = [scope.name.value for scope in self._scope]
        outermost = next((place for place, scope in enumerate(self._scope) if isinstance(scope, cst.FunctionDef)), 0)
        mutant = Mutant(
            path=self._path,
            function=".".join(names[: outermost + 1]) or self._constant,
            line=where.start.line,
            end_line=where.end.line,
            number=len(self.found),
            is_text=_only_text(before, after),
            in_signature=bool(self._signatures),
            is_constant=not names,
        )
        self.found.append((mutant, (before, after, shown)))


def _only_text(before: cst.CSTNode, after: cst.CSTNode) -> bool:
    """Whether only a text changes: a literal with a blank or a capital first letter, or an argument that is one."""
    if isinstance(before, cst.Call) and isinstance(after, cst.Call) and before.func is after.func:
        kept = {id(argument) for argument in after.args}
        gone = [argument.value for argument in before.args if id(argument) not in kept]
        return all(_is_text(value) for value in gone)
    return _is_text(before)


def _is_text(node: cst.CSTNode) -> bool:
    if isinstance(node, cst.FormattedString):
        return True
    if not isinstance(node, cst.SimpleString):
        return False
    value = node.evaluated_value
    return isinstance(value, str) and (" " in value or value[:1].isupper())


def mutated_files(only: Sequence[str] = ()) -> Iterator[MutatedFile]:
    """Each file, or each whose path matches one of the patterns, with all of its mutants."""
    for path in sorted({path for pattern in MUTATED for path in PROJECT.glob(pattern)}):
        if only and not any(path.match(pattern) for pattern in only):
            continue
        wrapper = MetadataWrapper(cst.parse_module(path.read_text(encoding="utf-8")), unsafe_skip_copy=True)
        collector = _Collector(path.relative_to(PROJECT).as_posix())
        wrapper.visit(collector)
        found = collector.found
        yield MutatedFile(collector._path, wrapper.module, [one for one, _ in found], [nodes for _, nodes in found])


def drawn(mutants: list[Mutant], sample: int, seed: int) -> list[Mutant]:
    """A random sample in random order: of each file at least 20 or all, the others over all files alike."""
    generator = random.Random(seed)
    by_path: dict[str, list[Mutant]] = {}
    for mutant in mutants:
        by_path.setdefault(mutant.path, []).append(mutant)
    chosen = [one for group in by_path.values() for one in generator.sample(group, min(LEAST_PER_MODULE, len(group)))]
    others = sorted(set(mutants).difference(chosen), key=lambda mutant: mutant.id)
    chosen += generator.sample(others, max(0, min(sample - len(chosen), len(others))))
    generator.shuffle(chosen)
    return chosen
