"""Lanes, small tensors, elementary functions: numba only, no MPI, no files."""
