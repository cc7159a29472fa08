"""Extensions by users' own packages, as entry points: effects, laws, outlines, formats of tables.

A package registers a module, or anything in one, under a group of :data:`GROUPS`; loading it
registers what is in it, as tympan's own modules do. In its pyproject.toml::

    [project.entry-points."tympan.effects"]
    lever = "my_package.lever"

Whatever a package does while it is loaded ends there: what it prints is dropped, what it changes of
the process is put back, and what it raises is kept for the commands that need it.
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
from importlib.metadata import EntryPoint, distributions, entry_points
from typing import Any, NoReturn

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.system import silent

#: Groups of entry points, and what their values are called.
GROUPS = {"tympan.effects": "an effect", "tympan.laws": "a law", "tympan.outlines": "an outline",
          "tympan.formats": "a format"}

#: So much of what a package says is told [characters].
_TOLD = 200

#: What a module may put in the place of, or change, in ``sys``.
_STREAMS = ("stdin", "stdout", "stderr", "__stdin__", "__stdout__", "__stderr__")
_HOOKS = ("excepthook", "unraisablehook", "displayhook", "argv")


def load_plugins(group: str, kinds: Registry[Any]) -> None:
    """Load every entry point of a group, which must register a new kind each.

    One that cannot be imported, registers nothing, or takes a name that is there already leaves an
    :class:`InputError` that names its package in the registry's ``broken``, for those who need it;
    what it had registered is forgotten.
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
    """The entry points of a group; a package whose list of them cannot be read is broken."""
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
    """An error in one line, whatever its class makes of itself."""
    said = "no words"
    with suppress(Exception):
        said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}"[:_TOLD]


def _package(point: EntryPoint) -> str:
    with suppress(Exception):  # what metadata that are no text or have no name raise
        if point.dist is not None:
            return str(point.dist.name)
    return "unknown"


@contextmanager
def _contained(came: list[int]) -> Iterator[None]:
    """Put back what is changed meanwhile of streams, folder, environment and settings.

    ``came`` gets the numbers of signals that come meanwhile.
    """
    import logging  # where no package adds anything it is not needed

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
    """A descriptor of the working folder, which may be gone."""
    with suppress(OSError):
        return os.open(".", os.O_RDONLY)
    return None


@contextmanager
def _signals(came: list[int]) -> Iterator[None]:
    """Note the signals that come, and leave them to those who had them before."""
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
    """Let ``os._exit`` raise SystemExit, but in processes that are started meanwhile."""
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
    """Groups and values of what has been loaded, or was tried."""
    return set()
