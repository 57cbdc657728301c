"""Entries of arrays that a scene may lack."""

from decomposition.deferred import register_jitable


@register_jitable
def load_of(loads, a, i):
    """The acceleration of loads on a particle [m/s^2], 0 without loads."""
    if loads is None:
        return 0.0
    return loads[a, i]


@register_jitable
def free_of(clamp, a, i):
    """1, or 0 of a held component; 1 without held ones."""
    if clamp is None:
        return 1.0
    return clamp[a, i]
