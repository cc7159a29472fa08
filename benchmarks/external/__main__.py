"""``python -m benchmarks.external -o docs``: external.md and its pictures, some minutes.

With ``--only NAME`` the section of one case goes to standard output, its pictures to the folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.external import elastosil, rubber, spot, table2, vhb_temperature, vhb_voltage
from benchmarks.external.case import words
from tympan.progress import bar

CASES = {module.CASE.name: module.CASE
         for module in (table2, vhb_voltage, vhb_temperature, elastosil, rubber, spot)}


def main() -> None:
    """Write the page, or one section of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", type=Path, dest="output", required=True, metavar="DIR")
    parser.add_argument("--only", choices=tuple(CASES), help="one case alone")
    options = parser.parse_args()
    if options.only is not None:
        print(CASES[options.only].section(options.output))
        return
    sections = []
    with bar(len(CASES)) as progress:
        for case in CASES.values():
            progress(case.name)
            sections.append(case.section(options.output))
    page = words("page").rstrip() + "\n\n" + "\n\n".join(part.strip() for part in sections) + "\n"
    (options.output / "external.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
