"""Relaxing on several MPI ranks: each owns a piece of the Morton curve, and the bytes are those of one."""
