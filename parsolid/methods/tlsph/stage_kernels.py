"""What the stages of a step take from kinetic and stored energy, in the kernels; see `stage_losses`."""

from decomposition.deferred import register_jitable
from parsolid.numerics.lanes import lane, load, store, total
from parsolid.numerics.layout import load_correction, store_deformation_gradient
from parsolid.numerics.tensors import contract, formula


@register_jitable
def clamped(clamp, a, v):
    """v without components of which the multipliers (n, 4) are 0; None: all are free."""
    if clamp is None:
        return v
    return v * load(clamp, a, 0)


@register_jitable
def motion_loss(rates, update, a, mass, free, rate):
    """Kinetic energy [J] that the stages of a step take, in the last of them, from accelerations [m/s^2].

    rates (n, 8): those of the first two stages, or None where nothing is told; rate: of this stage.
    """
    if rates is None:
        return 0.0
    rate = clamped(free, a, rate)
    if not update.last:
        store(rates, a, 0 if update.first else 4, rate)
        return 0.0
    first, second = load(rates, a, 0), load(rates, a, 4)
    change = second - first
    rest = rate - 0.5 * (first + second)
    form = (first * (2.0 / 3.0) + change * (1.0 / 3.0) + rest * (4.0 / 9.0)) * rest + change * change * (1.0 / 12.0)
    return -0.5 * update.step * update.step * mass * total(form)


@register_jitable
def note_stage(stages, space, update, i, G, P, count):
    """Keep the velocity gradient and P of the first two stages."""
    if stages is None:
        return
    if update.first:
        store_deformation_gradient(space, stages.first_rate, i, G, G[0], count)
        store_deformation_gradient(space, stages.first_stress, i, P, P[0], count)
    elif not update.last:
        store_deformation_gradient(space, stages.second_rate, i, G, G[0], count)
        store_deformation_gradient(space, stages.second_stress, i, P, P[0], count)


@formula
def _form(G1, G2, G3, P1, P2, P3, P4):
    """That of `motion_loss` with C of the second factors times step^2: C : dF of stages is the change of P."""
    change, rest = G2 - G1, G3 - 0.5 * (G1 + G2)
    first = P2 - P1
    later = 4.0 * (P3 - P1) - 2.0 * first
    last = 1.5 * (P4 - 2.0 * P3 + P1)
    terms = (2.0 / 3.0) * first + (1.0 / 3.0) * later + (4.0 / 9.0) * last
    return contract(rest, terms) + (1.0 / 12.0) * contract(change, later)


@register_jitable
def strain_loss(stages, space, i, step, last, volume, count):
    """Stored energy [J] that the stages of a step [s] take from the first `count` of particles i..i+3.

    last: the velocity gradient and P of the last stage, and P after it.
    """
    if stages is None:
        return 0.0
    first, second = load_correction(space, stages.first_rate, i), load_correction(space, stages.second_rate, i)
    start, middle = load_correction(space, stages.first_stress, i), load_correction(space, stages.second_stress, i)
    form, result = volume * _form(first, second, last[0], start, middle, last[1], last[2]), 0.0
    for k in range(count):
        result -= 0.5 * step * lane(form, k)
    return result
