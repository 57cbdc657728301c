"""Particle kernel of the material point method for hyperelastic laws: the step's rate advances F, and the stress
follows from it.
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import equilibrium_energy, first_piola_kirchhoff_stress, pressure_wave_tensor
from parsolid.methods.mpm.layout import load_rate, store_stress
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import WIDTH, all_positive, broadcast, from_floats, lane
from parsolid.numerics.layout import four_rows
from parsolid.numerics.polar import congruence, symmetric_part
from parsolid.numerics.tensor_rows import largest_lane, load_general, speed_of, store_general
from parsolid.numerics.tensors import cofactor, contract, determinant, lane_of_general, trace


@register_jitable
def _eigenvalue_bound(q):
    """No less than the largest eigenvalue of a symmetric tensor; equal to it where the two others are equal."""
    mean = trace(q) * (1.0 / 3.0)
    deviator = contract(q, q) - 3.0 * mean * mean
    return mean + math.sqrt(max(deviator, 0.0) * (2.0 / 3.0))


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_elastic_stress(space, first, last, law, step, deformation, motion, rate, stress):
    """Advance F of particles first..last-1 by a step [s] with the velocity gradients `rate`, and write V sigma.

    Arrays as for `plastic_update.advance_stress`. Returns (sound, largest c + |v| [m/s]): c of the present
    configuration; sound is False when a Jacobian is not positive.
    """
    sound, fastest = True, broadcast(0.0)
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        F = load_general(space, deformation, i)
        F = F + step * (load_rate(space, rate, i) @ F)
        H, J = cofactor(F), determinant(F)
        P = first_piola_kirchhoff_stress(law, F, H, J, None)
        velocity = four_rows(motion, i, 4)
        store_general(space, deformation, i, F, count)
        # a wave with normal n has rho0 c^2 = N.Q N with N = F^T n of the reference configuration
        waves = _eigenvalue_bound(congruence(F, pressure_wave_tensor(law, F, H, J, None)))
        valid = float(count) - from_floats(0.5, 1.5, 2.5, 3.5)
        speed = math.sqrt(waves * (1.0 / law.density)) + speed_of(velocity)
        # V sigma = V0 P F^T
        store_stress(space, stress, i, symmetric_part(velocity[3] * (P @ F.T)), speed)
        fastest = choose(valid, max(speed, fastest), fastest)
        if not all_positive(choose(valid, min(J, speed), 1.0)):
            sound = False
    return sound, largest_lane(fastest)


@compiled(error_model="numpy")
def elastic_energy(space, first, last, law, deformation, motion):
    """Sum of W V0 [J] of particles first..last-1."""
    energy = 0.0
    for i in range(first, last, WIDTH):
        F4 = load_general(space, deformation, i)
        H4, J4 = cofactor(F4), determinant(F4)
        for k in range(min(WIDTH, last - i)):
            W = equilibrium_energy(law, lane_of_general(F4, k), lane_of_general(H4, k), lane(J4, k))
            energy += W * motion[i + k, 7]
    return energy
