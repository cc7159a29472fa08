"""Worker processes: only the process that starts them acts on signals, and they end with it."""

from __future__ import annotations

import atexit
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from typing import Any, Generic, Self, TypeVar, cast
from weakref import WeakSet

from tympan.base.process.interruption import ENDING, signals_wait
from tympan.base.process.threads import stay_single

Item = TypeVar("Item")
Value = TypeVar("Value")

#: Longest wait of a pool for its killed processes [s]. They are gone within milliseconds; the bound
#: is for a process that the system fails to end.
_GONE = 5.0

#: Processes that :func:`start_worker` started here.
_STARTED: WeakSet[BaseProcess] = WeakSet()

#: Set as soon as this process leaves.
_LEAVING = threading.Event()


class WorkerDied(Exception):
    """The process that computed an item died."""


class _InWorker(Exception):
    """Traceback of an error in a worker process, as the cause of the error raised here."""


@dataclass(frozen=True)
class Answer(Generic[Value]):
    """Value of an item, or the error in its place, with its traceback in the worker.

    If not ``started``, no process could be started to compute it.
    """

    value: Value | None = None
    error: BaseException | None = None
    traceback: str = ""
    started: bool = True

    def result(self) -> Value:
        """Return the value, or raise the error."""
        if self.error is None:
            return cast(Value, self.value)
        if self.traceback:
            self.error.__cause__ = _InWorker(f"\n{self.traceback}")
        raise self.error


class Pool(Generic[Item, Value]):
    """Processes that compute a function of items; at the end of a ``with`` they are killed.

    Each process has a thread here and a pipe of its own. So a process that dies, at any moment,
    harms no other, and its item is known. The threads are daemons: the end of the interpreter does
    not wait for them. A ``ProcessPoolExecutor`` would not do. The interpreter waits for its thread,
    which may wait for ever for the rest of an answer whose sender was killed; and its end waits
    for processes that nobody ends.
    """

    def __init__(self, function: Callable[[Item], Value], workers: int) -> None:
        self._function, self._most, self._owner = function, workers, os.getpid()
        self._workers: list[_Worker] = []
        self._threads: list[threading.Thread] = []
        self._items: SimpleQueue[tuple[str, Item] | None] = SimpleQueue()
        self._answers: SimpleQueue[tuple[str, Answer[Value]]] = SimpleQueue()
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    def put(self, key: str, item: Item) -> None:
        """Add an item for the next free process; start another one while there may be more."""
        self._items.put((key, item))
        if len(self._threads) < self._most:
            worker = _Worker()
            thread = threading.Thread(target=self._attend, args=(worker,), daemon=True)
            with signals_blocked():  # the thread starts processes, and passes the block on to them
                thread.start()
                self._workers.append(worker)
                self._threads.append(thread)

    def get(self) -> tuple[str, Answer[Value]]:
        """Wait for the next item that is done; return its key and answer.

        An error that kept a process from being started is raised: it would affect every item.
        """
        key, answer = self._answers.get()
        if not answer.started:
            answer.result()
        return key, answer

    def close(self) -> None:
        """Kill the processes, whatever they are doing, and wait until they are gone."""
        if os.getpid() != self._owner:  # this is a fork: the processes belong to its parent
            return
        self._closed = True
        for worker in self._workers:
            worker.kill()
            self._items.put(None)
        end = time.monotonic() + _GONE
        for thread in self._threads:
            # The garbage collector may close a pool in any thread, also in one of its own.
            if thread is not threading.current_thread():
                thread.join(max(0.0, end - time.monotonic()))

    def _attend(self, worker: _Worker) -> None:
        """Give one item after another to a process, until the pool is closed."""
        try:
            while (task := self._items.get()) is not None and not self._closed:
                key, item = task
                self._answers.put((key, _answer(worker, self._function, item)))
        finally:
            worker.end()


class _Worker:
    """A process and its pipe, started again after its death.

    One thread starts, asks and ends it; others may kill it at any moment.
    """

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._killed = False

    def start(self) -> None:
        """Start the process if there is none."""
        if self._process is not None:
            return
        context = multiprocessing.get_context("spawn")
        pipe, other = context.Pipe()
        process = context.Process(target=_work, args=(other,))
        start_worker(process)
        other.close()  # or the end of the process would not be seen
        self._pipe, self._process = pipe, process
        if self._killed:
            process.kill()

    def ask(self, content: bytes) -> bytes:
        """Send an item to the process and return its answer, pickled; WorkerDied if it dies."""
        assert self._pipe is not None
        try:
            self._pipe.send_bytes(content)
            return self._pipe.recv_bytes()
        except (EOFError, OSError, MemoryError):
            self.end()
            raise WorkerDied from None

    def kill(self) -> None:
        """Kill the process for good, also one that is only just being started."""
        self._killed = True
        if (process := self._process) is not None:
            process.kill()

    def end(self) -> None:
        """Kill the process and wait until it is gone."""
        if self._process is not None and self._pipe is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
        self._process = self._pipe = None


def _answer(worker: _Worker, function: Callable[[Item], Value], item: Item) -> Answer[Value]:
    try:
        worker.start()
    except BaseException as error:  # any kind: it is raised where the answer is read
        return Answer(error=error, started=False)
    try:
        answer: Answer[Value] = pickle.loads(worker.ask(pickle.dumps((function, item))))
    except BaseException as error:  # any kind: it is raised where the answer is read
        return Answer(error=error)
    return answer


def _work(pipe: Connection) -> None:
    """Compute the items that come through a pipe, until the pool is gone."""
    begin_worker()
    with suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_computed(pipe.recv_bytes()))
    os._exit(0)  # without a wait for processes that a function may have left


def _computed(content: bytes) -> bytes:
    """Compute an item and pickle its answer; an error that cannot be sent is sent as text."""
    answer: Answer[Any]
    try:
        function, item = pickle.loads(content)
        return pickle.dumps(Answer(function(item)))
    except BaseException as error:  # any kind: it is raised where the answer is read
        answer = Answer(error=error, traceback=traceback.format_exc())
    try:
        sent = pickle.dumps(answer)
        pickle.loads(sent)
    except Exception:  # the error's own class may raise anything
        words = f"{type(answer.error).__name__}: {answer.error}"
        sent = pickle.dumps(Answer(error=RuntimeError(words), traceback=answer.traceback))
    return sent


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block signals in processes that are started meanwhile: the parent ends them."""
    resource_tracker.ensure_running()  # its start would lift the block
    with signals_wait():
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start_worker(process: BaseProcess) -> None:
    """Start a process that ignores signals and is killed when this one leaves.

    Raises
    ------
    RuntimeError
        When this process is already leaving.
    """
    _STARTED.add(process)
    if _LEAVING.is_set():
        raise RuntimeError("this process is ending: it starts no others")
    with signals_blocked():
        process.start()
    if _LEAVING.is_set():
        process.kill()


def begin_worker() -> None:
    """Set up a new process that computes: one thread, and an end with its parent."""
    stay_single()

    def follow(sentinel: int) -> None:
        wait_for([sentinel])
        os._exit(1)

    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=follow, args=(parent.sentinel,), daemon=True).start()


def _kill_started() -> None:
    """Kill the workers that are still running, but no process that another library started."""
    _LEAVING.set()
    for process in multiprocessing.active_children():
        if process in _STARTED:
            process.kill()


# The handler registered last runs first. So workers are gone before multiprocessing, which the
# imports above have registered, waits for them.
atexit.register(_kill_started)
# A fork inherits the objects, but the processes are its parent's.
os.register_at_fork(after_in_child=_STARTED.clear)
