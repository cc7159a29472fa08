"""A function of many things on a Dask cluster, as ``parallel`` has it on one machine."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from tympan.geometry.errors import InputError
from tympan.studies.parallel import Item, NoValue, Value, value_or_reason

_PATIENCE = "10s"

#: glibc's numbers of its thresholds for trimming and for mapping, from malloc.h, with its own
#: limits for both [bytes].
_TRIM, _MAP = (-1, 64 << 20), (-3, 32 << 20)
_TRIM_SET, _MAP_DEFAULT = "MALLOC_TRIM_THRESHOLD_", 128 << 10


def cluster(function: Callable[[Item], Value], items: Mapping[str, Item], address: str
            ) -> Iterator[tuple[str, Value | NoValue]]:
    """Values by key as they come back from a scheduler, such as at ``tcp://10.0.0.5:8786``.

    Dask tries an item again when its worker dies; one over which several died is given up, as Dask
    is set up to.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("wants Dask: pip install 'tympan[cluster]'", key="--scheduler",
                         given=address) from None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers there within {_PATIENCE}: "
                         f"{str(error) or type(error).__name__}", key="--scheduler",
                         given=address) from None
    try:
        futures = client.map(partial(_hoarded, function), list(items.values()),
                             key=[f"tympan-{key}" for key in items], pure=False)
        keys = dict(zip((future.key for future in futures), items, strict=True))
        done = as_completed(futures, loop=client.loop)
        futures.clear()
        for future in done:
            yield keys[future.key], value_or_reason(future)
            future.release()
    finally:
        client.close(timeout=2)


def _hoarded(function: Callable[[Item], Value], item: Item) -> Value:
    """A value, freed memory kept meanwhile.

    Dask starts its workers so that they give back every array they free, to look small while they
    wait. Taking the pages again made a specimen 40 % slower.
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
