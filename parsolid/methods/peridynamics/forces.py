"""From a peridynamic scene to the bonds of a rank's particles and the forces of its laws."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import Conditions
from parsolid.collective import raise_together
from parsolid.materials.blocks import block_numbers, material_blocks
from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.registry import laws_of
from parsolid.methods.peridynamics.bond_based import BondBasedForces
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.correspondence import CorrespondenceForces
from parsolid.methods.peridynamics.plastic import flows
from parsolid.methods.peridynamics.solids import (
    has_tensor_history,
    is_small_strain,
    series_of,
    undeformed_wave_modulus,
)
from parsolid.methods.peridynamics.tangent import algorithmic_law
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.generated import declare_generated
from parsolid.particles.law_values import declare_law_values


def particles_of(scene: Any, particle_set: Any) -> Particles:
    """The container of a rank's particles, sorted by law, with the fields of their generation."""
    laws = laws_of(scene)
    particles = Particles(particle_set.body, block_numbers(laws, np.arange(len(laws)))[1])
    declare_generated(particles, particle_set, ("identifier",), reference_position=Columns())
    return particles


def build_forces(
    comm: Any, scene: Any, particle_set: Any, conditions: Conditions
) -> CorrespondenceForces | BondBasedForces:
    """Bonds of this rank's particle_set, sorted by law, and the forces of the scene's laws. Collective.

    Raises SolverError on all ranks when particles cannot be bonded or laws do not go together.
    """
    laws, settings = laws_of(scene), scene.method
    raise_together(comm, _faults(scene, laws))
    blocks, density = material_blocks(laws, particle_set.body)
    particles, share, d = conditions.particles, conditions.share, particle_set.position.shape[1]
    told: dict[str, Any] = {"checkpointed": True, "shown": True, "ghosts": "forward", "message": "motion"}
    particles.declare(Field("displacement", d, "m", mirror="vector", layout=Columns(), **told))
    particles.declare(Field("mass", 1, "kg"), density * particle_set.volume / share)
    particles.declare(Field("share", 1, "1"), share)
    declare_law_values(comm, scene, particles, particle_set, laws)
    bonds = Bonds(comm, particles, settings, particle_set, conditions)
    fixed = np.zeros((len(particle_set), bonds.d), bool)
    for plane in conditions.planes:
        if plane.kind == "fixed":
            fixed[:, plane.axis] |= plane.contains(particle_set)
    if isinstance(laws[0], BondBased):
        return BondBasedForces(bonds, blocks, settings, fixed)
    # the scales (n,) of the control [Pa] and of that on velocities [Pa s], None where no law of the scene has it; the
    # latter is 0 without control
    spacing = particle_set.spacing.max(axis=1)
    elastic, viscous = np.zeros((2, len(spacing)))
    for block in blocks:
        own, law = slice(block.first, block.last), block.law
        if flows(law):
            impedance = np.sqrt(law.density * undeformed_wave_modulus(law))
            viscous[own] = settings.stabilisation.viscous_factor * impedance * spacing[own]
        else:
            elastic[own] = settings.stabilisation.factor * algorithmic_law(law, 0.0).shear_modulus
    flow = list(map(flows, laws))
    stores = settings.stabilisation.kind != "none" and not all(flow)
    scales = elastic if stores else None, viscous if any(flow) else None
    return CorrespondenceForces(bonds, blocks, laws, settings, scales, fixed)


def _faults(scene: Any, laws: list[Any]) -> str | None:
    """What of a scene's laws do not go together."""
    damage = scene.method.damage
    if damage is not None and damage.criterion == "energy" and len(set(map(series_of, laws))) > 1:
        return "method.damage.criterion: expected 'stretch' where bodies relax differently, found 'energy'"
    turns = any(series_of(law)[0] and has_tensor_history(law) and not is_small_strain(law) for law in laws)
    if not scene.method.stabilisation.relaxes and not turns:
        return "method.stabilisation.relaxes: expected a viscous body of finite strain, which it is for, found none"
    for index, law in enumerate(laws):
        if isinstance(law, BondBased) != isinstance(laws[0], BondBased):
            return f"bodies.{index}.material.kind: expected all bodies or none to be bond-based, found both kinds"
    return None
