"""What users' own packages add, by entry points: effects, laws, outlines, formats of tables.

A package registers a module, or anything in one, under a group of :data:`GROUPS`; loading it
registers what is in it, as tympan's own modules do. In its pyproject.toml::

    [project.entry-points."tympan.effects"]
    lever = "my_package.lever"
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Registry

#: Groups of entry points, and what their values are called.
GROUPS = {"tympan.effects": "an effect", "tympan.laws": "a law", "tympan.outlines": "an outline",
          "tympan.formats": "a format"}


def load_plugins(group: str, kinds: Registry[Any]) -> None:
    """Load every entry point of a group, which must register a new kind each.

    An :class:`InputError` that names the package where one cannot be imported, registers nothing,
    or takes a name that is there already; what it had registered is forgotten.
    """
    for point in sorted(entry_points(group=group), key=lambda point: (_package(point), point.name)):
        if (group, point.value) not in _loaded():
            before = dict(kinds)
            try:
                _load(point, group, kinds, before)
            except InputError:
                kinds.clear()
                kinds.update(before)
                raise
            _loaded().add((group, point.value))


def _load(point: EntryPoint, group: str, kinds: Registry[Any],
          before: dict[str, Any]) -> None:
    place = f"package {_package(point)}, entry point {point.name!r} of {group}"
    try:
        plugin = point.load()
    except Exception as error:  # whatever a user's module raises when it is imported
        raise InputError(f"cannot be loaded: {type(error).__name__}: {error}", key=place,
                         given=point.value) from error
    if getattr(getattr(plugin, "__spec__", None), "_initializing", False):
        return  # it is being imported already, and imports tympan
    taken = [name for name, kind in before.items() if kinds.get(name) is not kind]
    if taken:
        raise InputError(f"must have a name of its own: there is already {GROUPS[group]} "
                         f"{taken[0]}", key=place, given=point.value)
    if len(kinds) == len(before):
        raise InputError(f"must register {GROUPS[group]}", key=place, given=point.value)


def _package(point: EntryPoint) -> str:
    return "unknown" if point.dist is None else point.dist.name


@cache
def _loaded() -> set[tuple[str, str]]:
    """Groups and values of what has been loaded."""
    return set()
