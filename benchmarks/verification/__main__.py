"""Run every claim and write ``docs/verification.md``.

The exit status is 1 if a claim does not hold.

Run as ``python -m benchmarks.verification``.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def main(arguments: list[str] | None = None) -> int:
    """The command; progress goes to standard error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs",
                        help="folder of the page and its picture")
    output = parser.parse_args(arguments).output
    if str(ROOT / "tests") not in sys.path:  # the references are the tests'
        sys.path.insert(0, str(ROOT / "tests"))
    from benchmarks.verification import page

    judged: page.Judged = {}
    for claim in page.claims():
        began = time.perf_counter()
        judged[claim] = list(claim.judged())
        holds = all(fine for _, fine in judged[claim])
        print(f"{'holds' if holds else 'FAILS'}  {time.perf_counter() - began:5.1f} s  "
              f"{claim.title}", file=sys.stderr)
    output.mkdir(parents=True, exist_ok=True)
    (output / "verification.md").write_text(page.written(judged), encoding="utf-8")
    page.draw(output / "verification.png")
    return 0 if all(fine for pairs in judged.values() for _, fine in pairs) else 1


if __name__ == "__main__":
    sys.exit(main())
