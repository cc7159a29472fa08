"""Batches of readings, each in a process of its own."""

from __future__ import annotations

import argparse
import json
import secrets
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, given, seed, settings

from benchmarks.trials.fuzz.reading import inputs, survive

#: Time of a batch on the clock [s].
_PATIENCE = 1800
#: Examples of a batch.
_BATCH = 500


def batch(number: int, folder: Path, only: str) -> None:
    """Read examples of a seed, each of which is kept in a folder until the next one."""
    count: Counter[str] = Counter()

    @seed(number)
    @settings(max_examples=_BATCH, database=None, deadline=None,
              suppress_health_check=list(HealthCheck))
    @given(inputs(only))
    def reading(item: tuple[str, bytes]) -> None:
        name, content = item
        (folder / "last").write_bytes(name.encode() + b"\n" + content)
        survive(name, content)
        count[name] += 1

    try:
        reading()
    finally:
        print(json.dumps(count))


def _counts(output: str) -> dict[str, int]:
    """What a batch printed last; nothing where it was killed before."""
    last = output.splitlines()[-1:]
    return json.loads(last[0]) if last and last[0].startswith("{") else {}


def main() -> int:
    """Batches until the time is over; 1 where there was a find."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trials.fuzz",
                                     description="Read inputs that were changed at random.")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first batch")
    parser.add_argument("--only", default="", help="kinds with this word")
    parser.add_argument("--batch", type=Path, metavar="DIR", help="one batch alone")
    options = parser.parse_args()
    first = secrets.randbelow(10**6) if options.seed is None else options.seed
    if options.batch is not None:
        batch(first, options.batch, options.only)
        return 0
    ends = time.monotonic() + 60 * options.minutes
    number, finds = first, 0
    count: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        while number == first or time.monotonic() < ends:
            command = [sys.executable, "-m", "benchmarks.trials.fuzz", "--batch", scratch,
                       "--seed", str(number), "--only", options.only]
            try:
                done = subprocess.run(command, capture_output=True, text=True, check=False,
                                      timeout=_PATIENCE)
                said, ended = done.stdout + done.stderr[-4000:], done.returncode
                count.update(_counts(done.stdout))
            except subprocess.TimeoutExpired:
                said, ended = f"no end within {_PATIENCE} s", 1
            if ended:
                finds += 1
                read = [file.read_bytes()[:4000] for file in Path(scratch).glob("last")]
                print(f"seed {number} ended with {ended}\n{said}\nlast read: {read}", flush=True)
            number += 1
    print(", ".join(f"{name} {times}" for name, times in sorted(count.items())))
    print(f"{count.total()} inputs read, seeds {first} to {number - 1}: {finds} finds")
    return int(finds > 0)


if __name__ == "__main__":
    sys.exit(main())
