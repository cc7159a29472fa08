"""A plugin of pytest: what each test ran, how long it took, how it ended.

It writes JSON lines as tests begin and end, so that nothing is lost where a run hangs or is
killed: into ``$TYMPAN_MUTANTS_LOG``, which a number of the process is added to. In a recorded run
it also names the contexts of blocks. What a fixture of a module or session runs, or a function
that keeps its results, is a context of its own, shared by all tests that use it.
"""

from __future__ import annotations

import functools
import json
import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import block_trace
import pytest

_INSIDE = str(Path(__file__).parent)


def _seconds() -> float:
    """Processor time of this process and of those it has waited for [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


class Contexts:
    """Contexts within contexts: a test, a fixture it is the first to use, what that calls."""

    def __init__(self) -> None:
        self.log = Path(f"{os.environ['TYMPAN_MUTANTS_LOG']}-{os.getpid()}")
        self._names = [""]
        self._inner = [0.0]
        self._kept: dict[str, Any] = {}
        self._shared: dict[str, tuple[int, float, set[str]]] = {}
        self.failed = False
        file = str(self.log) + ".current"
        self._current = os.open(file, os.O_WRONLY | os.O_CREAT)
        os.environ["TYMPAN_MUTANTS_CURRENT"] = file
        self._begin("")

    def write(self, **entry: Any) -> None:
        """Write a line of the log."""
        with self.log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")

    def _begin(self, name: str) -> None:
        if block_trace.TRACE is not None:
            os.ftruncate(self._current, os.pwrite(self._current, name.encode(), 0))
            block_trace.TRACE.begin(name)

    @contextmanager
    def test(self, name: str, fixtures: Callable[[], list[str]]) -> Iterator[None]:
        """Record a test, and then what it was the first to run of contexts that are shared."""
        self.write(begin=name)
        self.failed = False
        with self.shared(name):
            yield
        for context, (runs, seconds, uses) in self._shared.items():
            more = {"fixtures": fixtures(), "failed": self.failed} if context == name else {}
            self.write(context=context, runs=runs, seconds=seconds, uses=sorted(uses), **more)
        self._shared.clear()
        if block_trace.TRACE is not None:
            block_trace.TRACE.end(name)

    @contextmanager
    def shared(self, name: str) -> Iterator[None]:
        """Record what runs within as that of a context, with its own processor time."""
        self._names.append(name)
        self._inner.append(0.0)
        used, began = self._uses(), _seconds()
        self._begin(name)
        try:
            yield
        finally:
            self._names.pop()
            self._begin(self._names[-1])
            spent, now = _seconds() - began, self._uses()
            runs, seconds, uses = self._shared.get(name, (0, 0.0, set()))
            self._shared[name] = (runs + 1, seconds + spent - self._inner.pop(), uses.union(
                key for key in now if now[key] != used.get(key, 0)))
            self._inner[-1] += spent

    def _uses(self) -> dict[str, int]:
        """How often each function that keeps its results was called."""
        return {name: sum(function.cache_info()[:2]) for name, function in self._kept.items()}

    def keep(self, function: Callable[..., Any], cached: Callable[[Any], Any]) -> Any:
        """A function with its results kept, whose runs are a context."""
        name = f"kept {function.__module__}.{function.__qualname__}"
        while name in self._kept:
            name += "'"

        @functools.wraps(function)
        def run(*arguments: Any, **named: Any) -> Any:
            if threading.current_thread() is not threading.main_thread():
                return function(*arguments, **named)
            with self.shared(name):
                return function(*arguments, **named)

        self._kept[name] = cached(run)
        return self._kept[name]


def _share_caches(root: str) -> None:
    """Make functions of this tree that keep results contexts of their own."""
    original = functools.lru_cache

    def cached(function: Callable[..., Any], size: int | None, typed: bool) -> Any:
        file = getattr(getattr(function, "__code__", None), "co_filename", "")
        # What a function in a function keeps is not shared by tests.
        if (not file.startswith(root) or "site-packages" in file
                or "<locals>" in function.__qualname__):
            return original(size, typed)(function)
        return CONTEXTS.keep(function, original(size, typed))

    def lru_cache(maxsize: Any = 128, typed: bool = False) -> Any:
        if callable(maxsize):
            return cached(maxsize, 128, typed)
        return lambda function: cached(function, maxsize, typed)

    functools.lru_cache = lru_cache
    functools.cache = lambda function: cached(function, None, False)


def _record_children() -> None:
    """Let processes record too that a test begins with an environment of its own."""
    original = subprocess.Popen.__init__

    @functools.wraps(original)
    def begin(self: Any, *arguments: Any, **named: Any) -> None:
        if named.get("env") is not None:
            paths = [_INSIDE, named["env"].get("PYTHONPATH", "")]
            recording = {name: os.environ[name] for name in ("TYMPAN_MUTANTS_MAP",
                                                             "TYMPAN_MUTANTS_CURRENT")}
            named["env"] = recording | named["env"] | {
                "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        original(self, *arguments, **named)

    subprocess.Popen.__init__ = begin  # type: ignore[method-assign]


#: Made at once: a conftest.py that is imported next may keep results.
CONTEXTS = Contexts()
if block_trace.TRACE is not None:
    _share_caches(str(Path.cwd()))
    _record_children()
#: The file of the last test.
_FILE = [""]


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[Any]:
    file = item.nodeid.partition("::")[0]
    if block_trace.TRACE is not None and _FILE[0] not in ("", file):
        # What another file has left on the disk is computed again.
        os.environ["TYMPAN_CACHE"] = f"{CONTEXTS.log}.caches/{abs(hash(file))}"
    _FILE[0] = file
    with CONTEXTS.test(item.nodeid, lambda: list(getattr(item, "fixturenames", []))):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Iterator[Any]:
    if fixturedef.scope == "function":
        return (yield)
    with CONTEXTS.shared(f"fixture {fixturedef.baseid}::{fixturedef.argname}"):
        return (yield)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    CONTEXTS.failed |= report.failed
    if report.failed:
        CONTEXTS.write(failure=report.nodeid)


def pytest_collection_finish(session: pytest.Session) -> None:
    if "TYMPAN_MUTANTS_COLLECTED" in os.environ:
        Path(os.environ["TYMPAN_MUTANTS_COLLECTED"]).write_text(
            json.dumps([item.nodeid for item in session.items]), encoding="utf-8")


