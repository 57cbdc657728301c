"""Laws of a scene's bodies and the state at time 0."""

import numpy as np

from parsolid.materials.mooney_rivlin import MooneyRivlin
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity


def laws_of(scene) -> list:
    """One law for each body."""
    return [_law(body.material) for body in scene.bodies]


def _law(material) -> MooneyRivlin:
    moduli = material.moduli
    return MooneyRivlin(
        density=float(material.density),
        xi=float(moduli.xi),
        zeta=float(moduli.zeta) or None,
        lambda_hat=float(moduli.lambda_hat),
        branch_moduli=tuple(map(float, material.branch_moduli)) or None,
        relaxation_times=tuple(map(float, material.relaxation_times)) or None,
    )


def initial_state(scene, cloud, method) -> None:
    """Set velocity, displacement and deformation gradient at time 0 by the bodies' formulas; collective."""
    table, place = method.table, (scene, cloud.body, cloud.position)
    table.owned_rows("velocity")[:] = initial_velocity(*place)
    displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
    derived = np.zeros(len(cloud), bool)
    if displacement is not None:
        table.owned_rows("position")[:] += displacement
        derived[:] = True
    if given is not None:
        gradient, where = given
        table.owned_rows("deformation_gradient")[:] = gradient.reshape(len(cloud), -1)
        derived &= ~where
    method.start(derived)
