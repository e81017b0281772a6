"""Settings for all tests."""

import os

# the oracle solves many tiny eigenvalue problems, in which BLAS threads only wait for one another
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
