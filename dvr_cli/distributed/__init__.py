"""Relaxing on several MPI ranks, each of which owns a range of the vertices: the bytes are those of one."""
