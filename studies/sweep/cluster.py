"""The same tasks on a Dask cluster; its scheduler is told where they are, and does the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from geometry.errors import InputError
from studies.sweep.pool import Found, outcome
from studies.sweep.task import Task

_PATIENCE = "10s"


def cluster(tasks: Sequence[Task], address: str) -> Iterator[Found]:
    """Hand the tasks to the scheduler at an address such as ``tcp://10.0.0.5:8786``, as they come back.

    Dask tries a task again when its worker dies; one over which several died is given up, as Dask is set up to.

    Raises
    ------
    InputError
        When ``distributed`` is not installed, or the scheduler does not answer.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("wants Dask: pip install 'tympan[cluster]'", key="--scheduler", given=address) from None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers there within {_PATIENCE}: {str(error) or type(error).__name__}",
                         key="--scheduler", given=address) from None
    try:
        futures = [client.submit(task.run, key=f"tympan-{task.id}", pure=False) for task in tasks]
        wanted = dict(zip((future.key for future in futures), tasks, strict=True))
        done = as_completed(futures, loop=client.loop)
        futures.clear()
        for future in done:
            yield wanted[future.key], outcome(future)
            future.release()
    finally:
        client.close(timeout=2)
