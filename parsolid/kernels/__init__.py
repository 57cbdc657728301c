"""numba kernels: no MPI, no files."""
