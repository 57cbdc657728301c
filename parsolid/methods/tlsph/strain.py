"""F, H, J of particles, evolved apart by the stages of a step, or H and J those of F."""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.layout import load_deformation, load_deformation_gradient
from parsolid.numerics.tensors import cofactor, determinant


@generic
def _strain(start, space, deformation, i):
    """F, H, J of particles i..i+3."""


@_strain.of(None)
def _strain_of_gradient(start, space, deformation, i):
    F = load_deformation_gradient(space, deformation, i)
    return F, cofactor(F), determinant(F)


@_strain.otherwise
def _strain_as_stored(start, space, deformation, i):
    return load_deformation(space, deformation, i)


@register_jitable
def load_strain(space, body, i):
    """F, H, J of particles i..i+3 of a `Body`."""
    return _strain(body.start, space, body.deformation, i)
