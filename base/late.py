"""Modules that are loaded when they are first used, if other packages import them without need."""

from __future__ import annotations

import sys
from importlib.util import LazyLoader, find_spec, module_from_spec


def load_late(*names: str) -> None:
    """Let modules of imported packages be loaded when one of their attributes is first read.

    It is the recipe of Python's documentation for :class:`importlib.util.LazyLoader`. A module that
    is already imported, or does not exist, is left alone. Not for modules that several threads may
    use first: until Python 3.12.3, one of them may then see the module half loaded.
    """
    for name in names:
        package, _, own = name.rpartition(".")
        spec = None if name in sys.modules else find_spec(name)
        if spec is None or spec.loader is None:
            continue
        spec.loader = LazyLoader(spec.loader)
        module = module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        # The import system sets it; without it, the package would import the module again.
        setattr(sys.modules[package], own, module)
