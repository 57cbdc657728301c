"""Boundary conditions and loads of a scene, on a rank's particles."""
