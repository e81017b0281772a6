"""numba's compiler, set up for this package; importing what is in here imports numba."""
