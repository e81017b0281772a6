"""Settings for all tests."""

import os

from hypothesis import settings

# the oracle solves many tiny eigenvalue problems, in which BLAS threads only wait for one another
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# an example may take long where others use the cores, too; CI takes the same examples every time
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") == "true" else "here")
