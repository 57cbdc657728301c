"""Shared by contact, tools and ties: friction as a spring with Coulomb's limit, and weights exact for linear fields.

Vectors are tuples of three numbers in any dimension, zero beyond it.
"""

from parsolid.kernels import inlined

# determinant over trace^d below which the moments of a neighbourhood count as singular
_SINGULAR = 1e-9


@inlined
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def combined(p, a, q, b):
    """p a + q b."""
    return p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]


@inlined
def tangential(a, normal):
    """The part of a perpendicular to a unit normal."""
    return combined(1.0, a, -dot(a, normal), normal)


@inlined
def turned(stretch, normal):
    """The stretch of a spring rotated into the plane of a unit normal; its length is kept."""
    flat = tangential(stretch, normal)
    square = dot(flat, flat)
    scale = (dot(stretch, stretch) / square) ** 0.5 if square > 0.0 else 0.0
    return combined(scale, flat, 0.0, flat)


@inlined
def return_mapping(before, trial, stiffness, most):
    """The stretch [m] of a spring of a stiffness [N/m] whose force is at most `most` [N], and the dissipation [J].

    before, trial: stretch before the step, and after it without slip (Cundall and Strack, Geotechnique 29, 1979). Slip
    dissipates the work of the mean of the forces before and after. Where a step reverses the spring while the normal
    force falls, this work would be negative, since the old force acts for half the step: then the spring keeps, for
    one step, the part of the old force for which the dissipation is zero, at most all of it.
    """
    square = dot(trial, trial)
    force = stiffness * square**0.5
    slips = force > most
    scale = most / force if slips else 1.0
    kept = min(-dot(before, trial) / square, 1.0) if slips else 0.0
    after = combined(max(scale, kept), trial, 0.0, trial)
    mean, slip = combined(0.5, before, 0.5, after), combined(1.0, trial, -1.0, after)
    return after, (0.0 if kept > scale else stiffness * dot(mean, slip))


@inlined
def linear_return(before, at, most_at, trial, stiffness, most):
    """The stretch [m] of `return_mapping`, linearised in trial and most about the values at and most_at."""
    square = dot(at, at)
    length = square**0.5
    kept = -dot(before, at) / max(square, 1e-300)
    if stiffness * length <= most_at or kept >= 1.0:
        return trial
    n = combined(1.0 / length, at, 0.0, at)
    across = tangential(combined(1.0, trial, -1.0, at), n)
    if kept * stiffness * length > most_at:
        along, more = kept * length, -dot(before, across) / length
    else:
        along, more = most_at / stiffness, (most - most_at) / stiffness
    return combined(along + more, n, along / length, across)


@inlined
def linear_weights(dimension, mean, second):
    """b of the weights w_j [1 + b . (x_j - x - mean)], exact for linear fields at x, where the w_j add up to one; zero
    where the points x_j do not span the space.

    mean (3) [m], second (6) [m^2] (xx, xy, xz, yy, yz, zz): sums of w_j times x_j - x and its products.
    """
    x, y, z = mean
    xx, xy, xz = second[0] - x * x, second[1] - x * y, second[2] - x * z
    yy, yz, zz = second[3] - y * y, second[4] - y * z, second[5] - z * z
    trace = xx + yy + zz
    if dimension < 3:
        zz = 1.0
    if dimension < 2:
        yy = 1.0
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * cxx + xy * cxy + xz * cxz
    scale = -1.0 / determinant if determinant > _SINGULAR * trace**dimension else 0.0
    return (
        scale * (cxx * x + cxy * y + cxz * z),
        scale * (cxy * x + cyy * y + cyz * z),
        scale * (cxz * x + cyz * y + czz * z),
    )


@inlined
def gap_correction(before, now):
    """Correction [m] of the impulse at the end of a step in which a gap closes or opens: exact impulse less that of the
    penetration `now` [m], over half the step and the stiffness; before [m]: penetration at the start. Negative: gaps.

    The penetration is linear in time. A gap that closes presses for part of the step only; one that opens has had the
    impulse of the whole first half at the start of the step, of which the excess is given back.
    """
    closes, opens = now > 0.0 >= before, before > 0.0 >= now
    rate = now - before if closes or opens else 1.0
    if closes:
        return now * (now / rate - 1.0)
    return -before * now / rate if opens else 0.0
