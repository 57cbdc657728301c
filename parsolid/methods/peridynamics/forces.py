"""From a peridynamic scene to bonds, the engine of their forces, and the history of its laws."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import raise_together
from parsolid.materials.damage.bond_based import BondBased, micromodulus
from parsolid.methods.peridynamics.bond_based import BondBasedForce, BondBasedHistory
from parsolid.methods.peridynamics.bond_force import BondForce
from parsolid.methods.peridynamics.bond_system import BondSystem, build_bond_system
from parsolid.methods.peridynamics.history_force import HistoryForce, TensorHistory
from parsolid.methods.peridynamics.operator import algorithmic_law
from parsolid.methods.peridynamics.tensor_history import has_tensor_history
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory, series_of
from parsolid.pairs.radial_weights import INFLUENCES
from parsolid.pairs.terms import AlongBonds, ShearScaled


class Forces(NamedTuple):
    """horizon (owned,) [m]; bond_system; engine: `BondForce` or one derived from it; history: that of its laws."""

    horizon: np.ndarray
    bond_system: BondSystem
    engine: BondForce
    history: Any


def build_forces(comm, scene, particle_set, laws: list, blocks: list, loads) -> Forces:
    """Bonds of this rank's particle_set and the forces of its laws; laws: one a body; loads: `PeridynamicLoads`. Collective.

    Raises SolverError on all ranks when particles cannot be bonded or bodies relax differently.
    """
    raise_together(comm, _unlike_series(laws))
    settings, share, dimension = scene.method, loads.share, particle_set.position.shape[1]
    horizon = np.array([settings.horizon(spacing) for spacing in particle_set.spacing.max(axis=1)])
    bond_system = build_bond_system(
        comm, INFLUENCES[settings.influence], horizon, particle_set, particle_set.volume / share, loads.codes
    )
    terms, fixed_planes = (
        len(series_of(laws[0])[0]),
        _fixed_planes(particle_set, loads.planes, bond_system.positions.shape[1]),
    )
    if isinstance(laws[0], BondBased):
        engine = BondBasedForce(bond_system, fixed_planes, blocks, share, horizon, settings, dimension)
        return Forces(horizon, bond_system, engine, BondBasedHistory(engine, blocks, terms, share))
    materials = {law: body.material for law, body in zip(laws, scene.bodies)}
    stabiliser, scale = _stabiliser(settings, dimension, blocks, materials, horizon)
    if any(has_tensor_history(law) for law in laws):
        engine = HistoryForce(bond_system, stabiliser, scale, fixed_planes, blocks, terms, share)
        return Forces(horizon, bond_system, engine, TensorHistory(engine, blocks, terms, share))
    engine = BondForce(bond_system, stabiliser, scale, fixed_planes)
    return Forces(horizon, bond_system, engine, ViscoelasticHistory(engine, blocks, terms, share))


def _stabiliser(settings, dimension: int, blocks: list, materials: dict, horizon: np.ndarray) -> tuple:
    """The stabiliser and its scale (owned,): coefficient times G [Pa], or c of eq (39), the micromodulus of the state of strain."""
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


def _fixed_planes(particle_set, planes: list, dimension: int) -> np.ndarray:
    """Normals (owned, dimension) of the fixed mirror planes each particle lies on; bars lie in the plane."""
    result = np.zeros((len(particle_set), dimension), bool)
    for plane in planes:
        if plane.kind == "fixed":
            result[:, plane.axis] |= plane.contains(particle_set)
    return result


def _unlike_series(laws: list) -> str | None:
    """A fault when bodies relax differently: the relaxing displacement is one field for all."""
    for index, law in enumerate(laws):
        if isinstance(law, BondBased) != isinstance(laws[0], BondBased):
            return f"bodies.{index}.material.kind: expected all bodies or none to be bond-based, found both kinds"
        if series_of(law) != series_of(laws[0]):
            return (
                f"bodies.{index}.material.terms: expected the ratios and times of bodies.0 (the relaxing displacement is one field), "
                "found others"
            )
    return None
