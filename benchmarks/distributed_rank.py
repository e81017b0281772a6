"""A rank that smooths a file by the command and loads nothing else, for its memory to be of that.

mpiexec -n N python benchmarks/distributed_rank.py ENGINE FILE [OPTION ...]
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
from pathlib import Path

from mpi4py import MPI

from dvr_cli.cli.main import main

engine, path, *more = sys.argv[1:]
with tempfile.TemporaryDirectory() as folder:
    output = str(Path(folder) / f"out{Path(path).suffix}")
    words = ["smooth", path, output, "--quiet", "--no-report", "--engine", engine, "--mpi"]
    assert main([*words, *more, "-n", "2"]) == 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    MPI.COMM_WORLD.Barrier()
said = MPI.COMM_WORLD.gather({"peak": float(peak)})
if said is not None:
    print(json.dumps(said), flush=True)
