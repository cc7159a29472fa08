"""Extensions by users' own packages, as entry points: effects, laws, outlines, films, formats.

A package registers a module, or anything in one, under a group of :data:`GROUPS`; loading it
registers what is in it, as tympan's own modules do. In its pyproject.toml::

    [project.entry-points."tympan.effects"]
    lever = "my_package.lever"

Whatever a package does while it is loaded has no effect outside: its output is dropped, its changes
to the process are undone, and its errors are kept for the commands that need the package.
"""

from __future__ import annotations

import builtins
import io
import locale
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.system import silent

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

#: Groups of entry points, and what their values are called.
GROUPS = {"tympan.effects": "an effect", "tympan.laws": "a law", "tympan.outlines": "an outline",
          "tympan.formats": "a format", "tympan.formulas": "a film"}

#: Most characters of a package's error that a message repeats.
_TOLD = 200

#: Attributes of ``sys`` that a module may replace or change.
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "unraisablehook", "displayhook", "argv")


def load_later(group: str, kinds: Registry[Any]) -> None:
    """Let a registry load its group by :func:`load_plugins` when it needs more than it has.

    To read the lists of all installed packages takes longer than to read a specimen.
    """
    kinds.more = partial(load_plugins, group)


def load_plugins(group: str, kinds: Registry[Any]) -> None:
    """Load every entry point of a group; each must register a new kind.

    An entry point that cannot be imported, registers nothing, or takes a name already in use
    leaves an :class:`InputError` that names its package in the registry's ``broken``, for the
    commands that need it. What it had registered is removed again.
    """
    for point in _points(group, kinds):
        if (group, point.value) not in _loaded():
            before = dict(kinds)
            _loaded().add((group, point.value))
            try:
                _load(point, group, kinds, before)
            except InputError as error:
                kinds.clear()
                kinds.update(before)
                kinds.broken.append(error)


def _points(group: str, kinds: Registry[Any]) -> list[EntryPoint]:
    """List the entry points of a group; a package whose list cannot be read is broken."""
    from importlib.metadata import distributions, entry_points  # it needs the package email

    try:
        points = list(entry_points(group=group))
    except Exception:  # whatever the files of an installation raise when they are parsed
        points = []
        for package in distributions():
            try:
                points += package.entry_points.select(group=group)
            except Exception as error:
                kinds.broken.append(InputError(f"cannot be read: {_told(error)}", key=(
                    f"package {getattr(package, '_path', 'unknown')}, entry points")))
    return sorted(points, key=lambda point: (_package(point), point.name))


def _load(point: EntryPoint, group: str, kinds: Registry[Any],
          before: dict[str, Any]) -> None:
    place = f"package {_package(point)}, entry point {point.name!r} of {group}"
    raised, came = None, list[int]()
    with _contained(came):
        try:
            plugin = point.load()
        except BaseException as error:  # a user's module may raise anything, also what ends others
            if came:
                raise
            raised = error
    if raised is not None:
        raise InputError(f"cannot be loaded: {_told(raised)}", key=place,
                         given=point.value) from raised
    if getattr(getattr(plugin, "__spec__", None), "_initializing", False):
        return  # it is being imported already, and imports tympan
    taken = [name for name, kind in before.items() if kinds.get(name) is not kind]
    if taken:
        raise InputError(f"must have a name of its own: there is already {GROUPS[group]} "
                         f"{taken[0]}", key=place, given=point.value)
    if len(kinds) == len(before):
        raise InputError(f"must register {GROUPS[group]}", key=place, given=point.value)


def _told(error: BaseException) -> str:
    """Write an error in one line, even if its class fails to."""
    said = "no words"
    with suppress(Exception):
        said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}"[:_TOLD]


def _package(point: EntryPoint) -> str:
    with suppress(Exception):  # metadata that are no text or have no name may raise anything
        if point.dist is not None:
            return str(point.dist.name)
    return "unknown"


@contextmanager
def _contained(came: list[int]) -> Iterator[None]:
    """Restore streams, folder, environment and settings that a package changes meanwhile.

    ``came`` gets the numbers of the signals that arrive meanwhile.
    """
    import logging  # only needed where a package is loaded

    environment, variables, names = os.environ, dict(os.environ), dict(vars(builtins))
    kept = {name: getattr(sys, name) for name in (*_STREAMS, *_HOOKS)}
    root, arguments, depth = logging.getLogger(), list(sys.argv), sys.getrecursionlimit()
    level, disabled, handlers = root.level, root.manager.disable, list(root.handlers)
    place, folder = locale.setlocale(locale.LC_ALL), _opened()
    try:
        with silent(), warnings.catch_warnings(), np.errstate(), _signals(came), _no_end():
            warnings.simplefilter("ignore")
            for name in _STREAMS:
                setattr(sys, name, io.TextIOWrapper(io.BytesIO(), "utf-8"))
            yield
    finally:
        vars(builtins).update(names)
        for name, value in kept.items():
            setattr(sys, name, value)
        sys.argv[:] = arguments
        sys.setrecursionlimit(depth)
        os.environ = environment  # noqa: B003  # the very object that was there
        if dict(environment) != variables:
            environment.clear()
            environment.update(variables)
        root.handlers[:] = handlers
        root.setLevel(level)
        logging.disable(disabled)
        if locale.setlocale(locale.LC_ALL) != place:
            locale.setlocale(locale.LC_ALL, place)
        if folder is not None:
            os.fchdir(folder)
            os.close(folder)


def _opened() -> int | None:
    """Open the working folder; None if it no longer exists."""
    with suppress(OSError):
        return os.open(".", os.O_RDONLY)
    return None


@contextmanager
def _signals(came: list[int]) -> Iterator[None]:
    """Note the signals that arrive, and pass them to the handlers they had before."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in signal.valid_signals()}
    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, partial(_noted, came, handler))
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None and signal.getsignal(number) is not handler:
                signal.signal(number, handler)


def _noted(came: list[int], handler: Callable[[int, Any], Any], number: int, frame: Any) -> Any:
    came.append(number)
    return handler(number, frame)


@contextmanager
def _no_end() -> Iterator[None]:
    """Let ``os._exit`` raise SystemExit, except in processes that are started meanwhile."""
    leave, process = os._exit, os.getpid()

    def refuse(status: int) -> NoReturn:
        if os.getpid() != process:
            leave(status)
        raise SystemExit(status)

    os._exit = refuse
    try:
        yield
    finally:
        os._exit = leave


@cache
def _loaded() -> set[tuple[str, str]]:
    """Keep the groups and values of the entry points already loaded or tried."""
    return set()
