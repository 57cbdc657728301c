"""From a peridynamic scene to bonds, the engine of their forces, and the history of its laws."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import raise_together
from parsolid.materials.blocks import block_numbers, material_blocks
from parsolid.materials.damage.bond_based import BondBased, micromodulus
from parsolid.materials.registry import laws_of
from parsolid.materials.viscoelastic.hyperelastic_series import HyperelasticSeries
from parsolid.methods.peridynamics.bond_based import BondBasedForce, BondBasedHistory
from parsolid.methods.peridynamics.bond_force import BondForce
from parsolid.methods.peridynamics.bond_system import build_bond_system, horizons
from parsolid.methods.peridynamics.history_force import ElasticControl, HistoryForce, TensorHistory
from parsolid.methods.peridynamics.operator import algorithmic_law
from parsolid.methods.peridynamics.tensor_history import has_tensor_history, is_small_strain
from parsolid.methods.peridynamics.unlike_series import UnlikeSeries
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory, series_of
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.terms import AlongBonds, ShearScaled
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field


class Forces(NamedTuple):
    """particles: the container, all but what the motion declares; horizon (owned,) [m]; bond_system; engine; history:
    of its laws.
    """

    particles: Particles
    horizon: np.ndarray
    bond_system: PairSystem
    engine: BondForce
    history: ViscoelasticHistory | UnlikeSeries


def particles_of(scene: Any, particle_set: Any) -> Particles:
    """The container of a rank's particles, sorted by law, without any field."""
    laws = laws_of(scene)
    return Particles(particle_set.body, block_numbers(laws, np.arange(len(laws)))[1])


def build_forces(comm: Any, scene: Any, particle_set: Any, loads: Any) -> Forces:
    """Bonds of this rank's particle_set, sorted by law, and the forces of the scene's laws; loads: `PeridynamicLoads`.
    Collective.

    Raises SolverError on all ranks when particles cannot be bonded or laws do not go together.
    """
    laws = laws_of(scene)
    series = list(dict.fromkeys(map(series_of, laws)))
    raise_together(comm, _faults(scene, laws, series))
    blocks, density = material_blocks(laws, particle_set.body)
    settings, share, dimension = scene.method, loads.share, particle_set.position.shape[1]
    particles = loads.particles
    particles.declare(Field("mass", 1, "kg"), density * particle_set.volume / share)
    particles.declare(Field("share", 1, "1"), share)
    horizon, bond_based = horizons(settings, particle_set), isinstance(laws[0], BondBased)
    materials = {law: body.material for law, body in zip(laws, scene.bodies)}
    stabiliser, scale = None, None
    engine: Any
    if not bond_based:
        stabiliser, scale = _stabiliser(settings, dimension, blocks, materials, horizon)
    made_of = comm, particles, settings, particle_set, share, stabiliser, loads.codes, scene.unbonded
    bond_system = build_bond_system(*made_of)
    fixed_planes = _fixed_planes(particle_set, loads.planes, bond_system.space.dimension)
    branches = max(len(ratios) for ratios, _ in series)
    if bond_based:
        engine = BondBasedForce(particles, bond_system, settings, blocks, horizon, fixed_planes)
        return Forces(particles, horizon, bond_system, engine, BondBasedHistory(engine, blocks, branches))
    history: Any = ViscoelasticHistory
    if any(has_tensor_history(law) for law in laws):
        engine, history = HistoryForce(particles, bond_system, scale, fixed_planes, blocks, branches), TensorHistory
    else:
        engine = BondForce(particles, bond_system, scale, fixed_planes)
    # each of several series tells a control of its own, while sums over a lattice know one
    one_control = len(series) == 1 or not settings.stabilisation.relaxes
    if settings.damage is None and not settings.pre_cracks and one_control:
        engine.stay_whole()
    if not settings.stabilisation.relaxes:
        return Forces(particles, horizon, bond_system, engine, ElasticControl(engine, blocks, branches))
    if len(series) > 1:
        return Forces(particles, horizon, bond_system, engine, UnlikeSeries(engine, blocks, series))
    return Forces(particles, horizon, bond_system, engine, history(engine, blocks, branches))


def _stabiliser(
    settings: Any, dimension: int, blocks: list[Any], materials: dict[str, Any], horizon: np.ndarray
) -> tuple[Any, ...]:
    """The stabiliser and its scale (owned,): coefficient times G [Pa], or c of eq (39), the micromodulus of the state
    of strain.
    """
    control = settings.stabilisation
    if control.kind == "none":
        return None, None
    scale = np.zeros(len(horizon))
    for block in blocks:
        rows = slice(block.first, block.last)
        if control.kind == "shear-scaled":
            scale[rows] = control.factor * algorithmic_law(block.law, 0.0).shear_modulus
        else:
            modulus = control.modulus or materials[block.law].equilibrium.youngs_modulus
            scale[rows] = control.factor * micromodulus(modulus, settings.state(dimension), "constant", horizon[rows])
    return (ShearScaled() if control.kind == "shear-scaled" else AlongBonds()), scale


def _fixed_planes(particle_set: Any, planes: list[Any], dimension: int) -> np.ndarray:
    """Normals (owned, dimension) of the fixed mirror planes each particle lies on; bars lie in the plane."""
    result = np.zeros((len(particle_set), dimension), bool)
    for plane in planes:
        if plane.kind == "fixed":
            result[:, plane.axis] |= plane.contains(particle_set)
    return result


def _kinds_mixed(laws: list[Any]) -> str | None:
    """A fault when some bodies are bond-based and some are not."""
    for index, law in enumerate(laws):
        if isinstance(law, BondBased) != isinstance(laws[0], BondBased):
            return f"bodies.{index}.material.kind: expected all bodies or none to be bond-based, found both kinds"
    return None


def _faults(scene: Any, laws: list[Any], series: list[Any]) -> str | None:
    """What of a scene's laws do not go together."""
    damage = scene.method.damage
    if len(series) > 1 and damage is not None and damage.criterion == "energy":
        return "method.damage.criterion: expected 'stretch' where bodies relax differently, found 'energy'"
    state = scene.method.state(scene.dimension)
    for index, law in enumerate(laws):
        if isinstance(law, HyperelasticSeries) and state in ("bar", "plane-stress"):
            return f"bodies.{index}.material.base: expected plane strain or space, found {state!r}"
    turns = any(series_of(law)[0] and has_tensor_history(law) and not is_small_strain(law) for law in laws)
    if not scene.method.stabilisation.relaxes and not turns:
        return "method.stabilisation.relaxes: expected a viscous body of finite strain, which it is for, found none"
    return _kinds_mixed(laws)
