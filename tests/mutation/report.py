"""The results as a table, a row a module, and the rate over all with its 95 % confidence interval."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence

from tests.mutation.mutants import Mutant

Row = dict[str, object]


def table(every: Sequence[Mutant], rows: Sequence[Row]) -> str:
    """Markdown: for each module its mutants, how many were run, how many survived and what part was killed."""
    lines = ["| module | mutants | run | killed | survived | rate |", "|---|---:|---:|---:|---:|---:|"]
    rows = [row for row in rows if row["verdict"] != "declares"]
    population = _counted(mutant.path for mutant in every if not mutant.is_text)
    kept = [row for row in rows if not row["is_text"]]
    for path, total in sorted(population.items()):
        of_it = [row for row in kept if row["path"] == path]
        killed = sum(row["verdict"] == "killed" for row in of_it)
        part = f"{100 * killed / len(of_it):.0f} %" if of_it else ""
        lines.append(f"| `{path}` | {total} | {len(of_it)} | {killed} | {len(of_it) - killed} | {part} |")
    lines += ["", f"Without texts: {estimate(population, kept)}."]
    lines += [f"With texts: {estimate(_counted(mutant.path for mutant in every), rows)}."]
    return "\n".join(lines)


def estimate(population: dict[str, int], rows: Sequence[Row]) -> str:
    """The rate over all mutants: of a sample, each module counts by the number of its mutants."""
    everything = sum(population[str(path)] for path in {row["path"] for row in rows})
    rate = variance = 0.0
    for path in {str(row["path"]) for row in rows}:
        of_it = [row for row in rows if row["path"] == path]
        total, tried = population[path], len(of_it)
        killed = sum(row["verdict"] == "killed" for row in of_it)
        weight = total / everything
        rate += weight * killed / tried
        likely = (killed + 1) / (tried + 2)  # not 0 or 1: few tries prove no certainty
        variance += weight**2 * likely * (1 - likely) / tried * (1 - tried / total)
    killed = sum(row["verdict"] == "killed" for row in rows)
    margin = 196 * math.sqrt(variance)
    within = f" ± {margin:.1f}" if margin > 0.05 else ""
    return f"{killed} of {len(rows)} killed; {100 * rate:.1f}{within} % of {everything}"


def _counted(paths: Iterable[str]) -> dict[str, int]:
    counts: dict[str, int] = defaultdict(int)
    for path in paths:
        counts[path] += 1
    return counts
