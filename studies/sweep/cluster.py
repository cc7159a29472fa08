"""A function of many items on a Dask cluster, as ``parallel`` has it on one machine."""

from __future__ import annotations

import asyncio
import ctypes
import os
import pickle
import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

from tympan.base.errors import Failure, InputError
from tympan.base.extras import needs
from tympan.base.progress import Progress
from tympan.studies.parallel import Item, NoValue, Value, value_or_reason
from tympan.studies.sweep.task import solver

#: Longest time for a scheduler's answer [s].
_PATIENCE = 10.0
#: Longest time for a worker to load tympan [s].
_LOADING = 20.0
#: Interval of checking whether there are workers [s].
_GLANCE = 1.0

#: Expression for a worker's version; a text, since a worker without tympan cannot load functions.
_SOLVER = "__import__('tympan.studies.sweep.task', fromlist=['solver']).solver()"

#: glibc's number of its trim threshold, from malloc.h, and its largest value [bytes].
_TRIM = (-1, 64 << 20)
#: glibc's number of its mmap threshold, and its largest value [bytes].
_MAP = (-3, 32 << 20)

#: Environment variable by which Dask sets the trim threshold.
_TRIM_SET = "MALLOC_TRIM_THRESHOLD_"
#: glibc's default mmap threshold [bytes].
_MAP_DEFAULT = 128 << 10


def cluster(function: Callable[[Item], Value], items: Mapping[str, Item], address: str,
            wait: float = 60.0, say: Progress = lambda words: None
            ) -> Generator[tuple[str, Value | NoValue], None, None]:
    """Yield values by key as they come back from a scheduler, such as ``tcp://10.0.0.5:8786``.

    Where there is no worker it waits ``wait`` seconds for one, and says so once. Dask tries an item
    again when its worker dies. After several deaths it gives up, according to its settings.

    Raises
    ------
    InputError
        When no scheduler answers at the address.
    Failure
        When there is no worker any more, or a worker has no tympan, or another version; the
        message names it.
    """
    needs("distributed", "a sweep on several computers")
    from distributed import Client

    _reach(address)
    client = Client(address, timeout=_PATIENCE, set_as_default=False)
    workers = _Workers(client, address, wait, say)
    ready: SimpleQueue[Any] = SimpleQueue()
    try:
        while not workers.present():
            time.sleep(_GLANCE)
        workers.check()
        # In a worker without tympan the call fails, and not the connection that brought it.
        calls = [pickle.dumps(_Call(function, item)) for item in items.values()]
        futures = client.map(pickle.loads, calls, key=[f"tympan-{key}" for key in items],
                             pure=False)
        waiting = dict(zip((future.key for future in futures), items, strict=True))
        for future in futures:
            future.add_done_callback(ready.put)
        futures.clear()
        while waiting:
            try:
                future = ready.get(timeout=_GLANCE)
            except Empty:
                workers.present()
                continue
            if future.cancelled():
                raise workers.scheduler_lost()
            if future.status == "error":
                workers.check()
            yield waiting.pop(future.key), value_or_reason(future.result)
            future.release()
    finally:
        client.close(timeout=2)


def _reach(address: str) -> None:
    """Refuse an address without a scheduler; Dask's client may try to connect for ever."""
    from distributed import rpc
    from distributed.security import Security

    async def kind() -> str:
        options = Security().get_connection_args("client")
        async with rpc(address, connection_args=options) as there:
            return str((await there.identity())["type"])

    try:
        answer = asyncio.run(asyncio.wait_for(kind(), _PATIENCE))
    except Exception as error:  # Dask raises any error where another protocol answers
        reason = f": {error}" if str(error) else ""
        raise InputError(f"no Dask scheduler answers there within {_PATIENCE:g} s{reason}",
                         key="--scheduler", given=address) from None
    if answer != "Scheduler":
        raise InputError(f"must be a scheduler: a Dask {answer.lower()} answers there",
                         key="--scheduler", given=address)


@dataclass
class _Workers:
    """Workers of a scheduler: whether there are any, and whether they can do the work."""

    client: Any
    address: str
    wait: float
    say: Progress
    checked: set[str] = field(default_factory=set)
    missed: float | None = None  # time since which there is no worker [s]

    def present(self) -> bool:
        """Test whether there is a worker; a Failure where there has been none for too long."""
        if self._addresses():
            self.missed = None
            return True
        if self.missed is None:
            self.missed = time.monotonic()
            self.say(f"no worker at {self.address}: waiting {self.wait:g} s for one, "
                     f"`dask worker {self.address}`")
        elif time.monotonic() - self.missed > self.wait:
            raise Failure(f"no worker came to {self.address} within {self.wait:g} s")
        return False

    def check(self) -> None:
        """Refuse new workers that have no tympan or another version than this process."""
        new = self._addresses() - self.checked
        if not new:
            return
        self.checked |= new
        try:
            answers = self.client.run(eval, _SOLVER, workers=list(new), on_error="return",
                                      callback_timeout=_LOADING)
        except TimeoutError:
            raise Failure(f"of these workers not all answer within {_LOADING:g} s: "
                          f"{', '.join(sorted(new))}") from None
        for worker, answer in answers.items():
            if isinstance(answer, str) and answer != solver():
                raise Failure(f"the worker at {worker} has another version: {answer}, here "
                              f"{solver()}")
            if isinstance(answer, Exception) and not isinstance(answer, OSError):  # it has gone
                raise Failure(f"the worker at {worker} cannot load tympan: "
                              f"{type(answer).__name__}: {answer}")

    def scheduler_lost(self) -> Failure:
        """Make the error for a scheduler that no longer answers."""
        return Failure(f"the scheduler at {self.address} does not answer any more")

    def _addresses(self) -> set[str]:
        try:
            return set(self.client.nthreads(callback_timeout=_LOADING))
        except Exception:  # the kind depends on the moment at which the scheduler stopped
            raise self.scheduler_lost() from None


@dataclass(frozen=True)
class _Call:
    """A call that is executed where it is unpickled, and becomes its value there."""

    function: Callable[[Any], Any]
    item: Any

    def __reduce__(self) -> tuple[Any, ...]:
        return _hoarded, (self.function, self.item)


def _hoarded(function: Callable[[Item], Value], item: Item) -> Value:
    """Compute a value while the process keeps freed memory.

    Dask starts its workers so that they give back every array they free, to need little memory
    while they wait. Fetching the pages again made a specimen 40 % slower.
    """
    wanted = os.environ.get(_TRIM_SET, "")
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if wanted.isdigit() else None
    if mallopt is None:
        return function(item)
    mallopt(*_TRIM)
    mallopt(*_MAP)
    try:
        return function(item)
    finally:
        mallopt(_TRIM[0], int(wanted))
        mallopt(_MAP[0], _MAP_DEFAULT)
