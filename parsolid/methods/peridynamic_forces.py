"""From a peridynamic scene to bonds, the engine of their forces, and the history of its laws."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels.bond_weights import INFLUENCES
from parsolid.kernels.pairs import AlongBonds, ShearScaled
from parsolid.materials.bond_based import BondBased, micromodulus
from parsolid.methods.bond_based import BondBasedForce, BondBasedRelaxation
from parsolid.methods.bond_force import BondForce
from parsolid.methods.bonding import Bonding, build_bonding
from parsolid.methods.history_force import HistoryForce, HistoryRelaxation
from parsolid.methods.peridynamic_operator import algorithmic_law
from parsolid.methods.relaxing import Relaxation, series_of
from parsolid.methods.tensor_history import has_tensor_history
from parsolid.together import raise_together


class Forces(NamedTuple):
    """horizon (owned,) [m]; bonding; engine: `BondForce` or one derived from it; relaxation: the history that goes with it."""

    horizon: np.ndarray
    bonding: Bonding
    engine: BondForce
    relaxation: Any


def build_forces(comm, scene, cloud, laws: list, groups: list, loads) -> Forces:
    """Bonds of this rank's cloud and the forces of its laws; laws: one a body; loads: `PeridynamicLoads`. Collective.

    Raises SolverError on all ranks when particles cannot be bonded or bodies relax differently.
    """
    raise_together(comm, _unlike_series(laws))
    settings, share, dimension = scene.method, loads.share, cloud.position.shape[1]
    horizon = np.array([settings.horizon(spacing) for spacing in cloud.spacing.max(axis=1)])
    bonding = build_bonding(comm, INFLUENCES[settings.influence], horizon, cloud, cloud.volume / share, loads.codes)
    terms, fixed_planes = len(series_of(laws[0])[0]), _fixed_planes(cloud, loads.planes, bonding.positions.shape[1])
    if isinstance(laws[0], BondBased):
        engine = BondBasedForce(bonding, fixed_planes, groups, share, horizon, settings, dimension)
        return Forces(horizon, bonding, engine, BondBasedRelaxation(engine, groups, terms, share))
    materials = {law: body.material for law, body in zip(laws, scene.bodies)}
    stabiliser, scale = _stabiliser(settings, dimension, groups, materials, horizon)
    if any(has_tensor_history(law) for law in laws):
        engine = HistoryForce(bonding, stabiliser, scale, fixed_planes, groups, terms, share)
        return Forces(horizon, bonding, engine, HistoryRelaxation(engine, groups, terms, share))
    engine = BondForce(bonding, stabiliser, scale, fixed_planes)
    return Forces(horizon, bonding, engine, Relaxation(engine, groups, terms, share))


def _stabiliser(settings, dimension: int, groups: list, materials: dict, horizon: np.ndarray) -> tuple:
    """The stabiliser and its scale (owned,): coefficient times G [Pa], or c of eq (39), the micromodulus of the state of strain."""
    control = settings.stabilisation
    if control.kind == "none":
        return None, None
    scale = np.zeros(len(horizon))
    for group in groups:
        rows = slice(group.first, group.last)
        if control.kind == "shear-scaled":
            scale[rows] = control.factor * algorithmic_law(group.law, 0.0).shear_modulus
        else:
            modulus = control.modulus or materials[group.law].equilibrium.youngs_modulus
            scale[rows] = control.factor * micromodulus(modulus, settings.state(dimension), "constant", horizon[rows])
    return (ShearScaled() if control.kind == "shear-scaled" else AlongBonds()), scale


def _fixed_planes(cloud, planes: list, dimension: int) -> np.ndarray:
    """Normals (owned, dimension) of the fixed mirror planes each particle lies on; bars lie in the plane."""
    result = np.zeros((len(cloud), dimension), bool)
    for plane in planes:
        if plane.kind == "fixed":
            result[:, plane.axis] |= plane.contains(cloud)
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
