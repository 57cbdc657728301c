"""A material point driven along a path of its deformation gradient, without particles."""
