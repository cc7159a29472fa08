"""Every command and option has its Python, by the same name, or a reason why not."""

from __future__ import annotations

import pytest

from tests.support import python_doors
from tests.support.python_doors import COMMON, OWN, WITHOUT, argument, in_python, options
from tympan.base.errors import InputError
from tympan.base.units import any_quantity
from tympan.commands import COMMANDS

NAMES = [command.name for command in COMMANDS]
#: Options whose default is another in Python, and why.
OTHERWISE = {
    ("diagnose", "workers"): "more than one process needs a main guard in the script",
    ("design", "workers"): "more than one process needs a main guard in the script",
    ("sweep", "workers"): "more than one process needs a main guard in the script",
}


@pytest.mark.parametrize("name", NAMES)
def test_a_command_has_its_door(name: str) -> None:
    if name in WITHOUT:
        with pytest.raises(AttributeError):
            python_doors.door(name)
        return
    assert callable(python_doors.door(name))
    missing = [action.dest for action in options(name) if in_python(name, action.dest) is None]
    assert not missing, f"{name}: add an argument of tympan.{name}, or words in python_doors"


@pytest.mark.parametrize("name", [name for name in NAMES if name not in WITHOUT])
def test_defaults_are_the_same(name: str) -> None:
    for action in options(name):
        door = argument(name, action.dest)
        if (door is None or action.required or action.dest in COMMON
                or (name, action.dest) in OTHERWISE | OWN):
            continue
        default = python_doors.arguments(name)[door].default
        if default is not python_doors.inspect.Parameter.empty:
            assert _plain(action.default) == _plain(default), action.dest


def _plain(value: object) -> object:
    """A default without its form: a text with unit is its SI value, nothing is None."""
    if isinstance(value, tuple | list) and len(value) == 1:
        value, = value
    try:
        found = any_quantity(value)
    except InputError:
        found = None
    value = value if found is None else found[0]
    return None if value in ("", (), [], False) else value


def test_the_table_has_nothing_that_is_not_there() -> None:
    everything = {(name, action.dest) for name in NAMES for action in options(name)}
    assert set(OWN) | set(OTHERWISE) <= everything
    assert set(COMMON) <= {option for _, option in everything}
    assert set(WITHOUT) <= set(NAMES)


def test_the_page_is_up_to_date() -> None:
    """If it fails: ``python -m tests.support.python_doors``."""
    assert python_doors.PAGE.read_text(encoding="utf-8") == python_doors.page()
