"""What the stages of a step take from kinetic and stored energy, in the kernels; see `stage_losses`."""

from decomposition.deferred import register_jitable
from parsolid.numerics.lanes import lane, load, store, total
from parsolid.numerics.layout import load_correction, store_deformation_gradient
from parsolid.numerics.tensors import add, contract, formula, scale


@register_jitable
def clamped(clamp, a, v):
    """v without components of which the multipliers (n, 4) are 0; None: all are free."""
    if clamp is None:
        return v
    return v * load(clamp, a, 0)


@register_jitable
def motion_loss(rates, update, a, mass, free, rate, gained):
    """Kinetic energy [J] that the stages of a step take, in the last of them, from accelerations [m/s^2].

    rates (n, 4): those of the first stage, or None where nothing is told; rate: of this stage; gained: velocity [m/s]
    of this stage less that at the start, in the last one step/2 times the mean of the first two rates.
    """
    if rates is None:
        return 0.0
    if update.first:
        store(rates, a, 0, clamped(free, a, rate))
    if not update.last:
        return 0.0
    first, mean = load(rates, a, 0), clamped(free, a, gained * (2.0 / update.step))
    rest, change = clamped(free, a, rate) - mean, mean - first
    form = (mean * (2.0 / 3.0) + rest * (4.0 / 9.0)) * rest + change * change * (1.0 / 3.0)
    return -0.5 * update.step * update.step * mass * total(form)


@register_jitable
def note_stage(stages, space, update, i, G, P, count):
    """Keep P of the first two stages, and the velocity gradient of the first."""
    if stages is None:
        return
    if update.first:
        store_deformation_gradient(space, stages.rate, i, G, G[0], count)
        store_deformation_gradient(space, stages.first, i, P, P[0], count)
    elif not update.last:
        store_deformation_gradient(space, stages.second, i, P, P[0], count)


@formula
def _form(mean, G1, G3, P1, P2, P3, P4):
    """That of `motion_loss` with C of the second factors times step^2: C : dF of stages is the change of P, by which
    its first three terms are 2/3 (P4 - P1)."""
    change = contract(mean - G1, 2.0 * P3 - P1 - P2)
    return (2.0 / 3.0) * contract(G3 - mean, P4 - P1) + (1.0 / 3.0) * change


@register_jitable
def strain_loss(stages, space, i, step, deformed, last, volume, count):
    """Stored energy [J] that the stages of a step [s] take from the first `count` of particles i..i+3.

    deformed: F at the start and of the last stage, which differ by step/2 times the mean of the first two gradients;
    last: the velocity gradient and P of the last stage, and P after it.
    """
    if stages is None:
        return 0.0
    mean = scale(2.0 / step, add(deformed[1], scale(-1.0, deformed[0])))
    G1, P1, P2 = (
        load_correction(space, stages.rate, i),
        load_correction(space, stages.first, i),
        load_correction(space, stages.second, i),
    )
    form, result = volume * _form(mean, G1, last[0], P1, P2, last[1], last[2]), 0.0
    for k in range(count):
        result -= 0.5 * step * lane(form, k)
    return result
