"""Work done beside other work, on a thread of its own where a run may use several."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

_Result = TypeVar("_Result")


def beside(threads: int, work: Callable[[], _Result]) -> Callable[[], _Result]:
    """A function that gives the result of ``work``, or raises what it raises; to be called once.

    With several threads work begins now, with one only when it is asked for.
    """
    if threads == 1:
        return work
    from concurrent.futures import ThreadPoolExecutor  # not for runs on one thread

    pool = ThreadPoolExecutor(1)
    future = pool.submit(work)
    pool.shutdown(wait=False)
    return future.result
