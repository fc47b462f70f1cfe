"""Changes the judge, the lease and the slow-down in one small place at a time, and counts which changes a test sees."""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict

import coverage


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--sample", type=int, default=0, help="so many mutants at random; all without it")
    parser.add_argument("--seed", type=int, default=18)
    parser.add_argument("--only", action="append", default=[], metavar="GLOB", help="files to mutate")
    parser.add_argument("--ids", type=argparse.FileType(), help="a file of mutants, one id a line")
    parser.add_argument("--budget", type=float, default=20.0, help="processor seconds of tests for one mutant")
    parser.add_argument("--longest", type=float, default=6.0, help="processor seconds of a test that still serves")
    parser.add_argument("tests", nargs="*", help="in place of all tests")
    options = parser.parse_args()

    recorder = coverage.Coverage(data_file=None, config_file=False, include=["monitor/*", "server/*"])
    recorder.start()  # before what is mutated is imported

    import pytest

    from tests.mutation.mutants import drawn, mutated_files
    from tests.mutation.report import table
    from tests.mutation.runner import OUT, TESTS, Runner

    files = list(mutated_files(options.only))
    by_path = {file.path: file for file in files}
    every = [mutant for file in files for mutant in file.mutants]
    chosen = drawn(every, options.sample, options.seed) if options.sample else every
    if options.ids:
        wanted = {line.split()[0] for line in options.ids if line.strip()}
        chosen = [mutant for mutant in every if mutant.id in wanted]
    OUT.mkdir(parents=True, exist_ok=True)
    started_s = time.monotonic()
    rows: list[dict[str, object]] = []
    with (OUT / "results.jsonl").open("w") as results:

        def done(mutant: object, verdict: str, took_s: float, by: str) -> None:
            row = asdict(mutant) | {
                "id": mutant.id,
                "change": by_path[mutant.path].change(mutant),
                "verdict": verdict,
                "took_s": round(took_s, 3),
                "by": by,
            }  # type: ignore
            rows.append(row)
            print(json.dumps(row), file=results, flush=True)
            if len(rows) % 50 == 0:
                print(f"{len(rows)}/{len(chosen)} {time.monotonic() - started_s:.0f} s", file=sys.stderr, flush=True)

        runner = Runner(recorder, files, chosen, options.budget, options.longest, done)
        marks = "not browser and not slow and not soak"
        status = pytest.main(
            [
                "-q",
                "-s",
                "-p",
                "no:cacheprovider",
                "-p",
                "no:xdist",
                "--timeout",
                "0",
                "-m",
                marks,
                *(options.tests or TESTS),
            ],
            plugins=[runner],
        )
    if status:
        return int(status)
    print(table(every, rows))
    print(f"{len(rows)} mutants in {time.monotonic() - started_s:.0f} s; each result in {OUT}/results.jsonl")
    return 0


if __name__ == "__main__":
    sys.exit(main())
