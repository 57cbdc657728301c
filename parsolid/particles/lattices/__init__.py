"""Lattices that fill boxes, shells, cylinders and spheres, made piece by piece."""
