"""Modules that are loaded late, and kinds of packages that are registered late."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tympan.base.fields import Registry
from tympan.base.late import load_late

#: What a process prints that loads a module late, and then uses it.
USE = """
import sys, types
import numpy
from tympan.base.late import load_late
assert "numpy.f2py" not in sys.modules
load_late("numpy.f2py", "numpy.nothing_of_this_name")
assert "numpy.nothing_of_this_name" not in sys.modules
assert not any(name.startswith("numpy.f2py.") for name in sys.modules)
import scipy.sparse
print(any(name.startswith("numpy.f2py.") for name in sys.modules))
import numpy.f2py
print(callable(numpy.f2py.get_include), type(numpy.f2py) is types.ModuleType)
"""


def test_a_module_is_loaded_when_it_is_used() -> None:
    done = subprocess.run([sys.executable, "-c", USE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True"]


def test_an_imported_module_is_left_alone() -> None:
    before = sys.modules["subprocess"]
    load_late("subprocess")
    assert sys.modules["subprocess"] is before


@pytest.mark.parametrize("use", [
    lambda kinds: "late" in kinds, lambda kinds: kinds["late"], lambda kinds: kinds.get("late"),
    lambda kinds: "late" in list(kinds), lambda kinds: len(kinds) == 2,
    lambda kinds: {*kinds.keys()} == {"own", "late"}, lambda kinds: 2 in kinds.values(),
    lambda kinds: ("late", 2) in kinds.items(), lambda kinds: dict(kinds)["late"],
    lambda kinds: kinds.whole() and dict.__contains__(kinds, "late")])
def test_kinds_of_packages_are_registered_when_they_are_needed(use) -> None:
    kinds: Registry[int] = Registry("law")
    kinds["own"] = 1
    calls = []

    def more(registry: Registry[int]) -> None:
        calls.append(1)
        registry["late"] = 2

    kinds.more = more
    assert kinds["own"] == kinds.get("own") == 1
    assert "own" in kinds
    assert not calls
    assert use(kinds)
    assert "unknown" not in kinds
    assert kinds.get("unknown") is None
    with pytest.raises(KeyError):
        kinds["unknown"]
    assert len(calls) == 1
