"""Commands with bad input, each in a process of its own: what they say, with what status, how soon.

    python -m benchmarks.trials.hostile [--only GROUP] [--list]

Every kind of input that once raised, hung or ended the process has a case. A case stands in the
file of its subject, in a function under ``@group``; a new file of this folder is found by itself.
"""

from __future__ import annotations

import importlib
import pkgutil

from benchmarks.trials.hostile.case import GROUPS, Case


def all_cases() -> dict[str, list[Case]]:
    """The cases of every group.

    Raises
    ------
    ValueError
        When two cases of a group have one name.
    """
    for module in sorted(entry.name for entry in pkgutil.iter_modules(__path__)):
        if module != "__main__":
            importlib.import_module(f"{__name__}.{module}")
    cases = {name: list(write()) for name, write in GROUPS.items()}
    for name, members in cases.items():
        names = [case.name for case in members]
        if len(set(names)) < len(names):
            raise ValueError(f"{name}: two cases have one name: {sorted(names)}")
    return cases
