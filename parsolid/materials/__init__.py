"""Material laws, one file each: a NamedTuple of parameters and numba overloads on its type."""
