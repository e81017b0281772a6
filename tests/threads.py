"""Ranks as threads of one process, for what ranks say to each other; no MPI is needed."""

from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from threading import Barrier
from types import SimpleNamespace

import numpy as np


class Threads:
    """The communicator of one rank, as mpi4py has it."""

    def __init__(self, rank, said, barrier, queues):
        self.rank, self.size, self._said, self._barrier = rank, len(said), said, barrier
        self._queues = queues

    def allgather(self, value):
        self._said[self.rank] = value
        self._barrier.wait()
        heard = list(self._said)
        self._barrier.wait()
        return heard

    def allreduce(self, value):
        return sum(self.allgather(value))

    def exscan(self, value):
        before = self.allgather(value)[: self.rank]
        return sum(before) if before else None

    def Allgather(self, value, heard):
        heard[:] = np.reshape(self.allgather(value), heard.shape)

    def Alltoall(self, values, heard):
        assert len(values) == self.size
        heard[:] = [of_rank[self.rank] for of_rank in self.allgather(values)]

    def isend(self, value, rank):
        self._queues[self.rank, rank].put(value)
        return SimpleNamespace(wait=lambda: None)

    def recv(self, source):
        return self._queues[source, self.rank].get(timeout=60)


def on_threads(ranks, work):
    """What work(comm) returns on each of so many ranks."""
    said, barrier = [None] * ranks, Barrier(ranks)
    queues = {(a, b): SimpleQueue() for a in range(ranks) for b in range(ranks)}

    def of(rank):
        try:
            return work(Threads(rank, said, barrier, queues))
        except BaseException:
            barrier.abort()
            raise

    with ThreadPoolExecutor(ranks) as pool:
        return list(pool.map(of, range(ranks)))
