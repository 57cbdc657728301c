"""Error bars of equilibria of meshes of which no coarser ones are made, from one run: an estimate of another kind.

The nodes of a mesh have mean gradients of the elements around them. What the elements store beyond these, E, over the
strain energy W is the square of the relative error in energy that linear elements would have (Zienkiewicz and Zhu, Int.
J. Numer. Meth. Eng. 33 (1992) 1331); errors of this method fall with it. Energies and forces err by a factor times E/W,
stresses at nodes by one times its root, with factors by which 95 of 100 values lie within them (docs/error-bars.md).
Displacements, and all in motion, have no such bar: their errors over E/W differ from part to part by factors of ten and
more.
"""

from typing import Any

import numpy as np

from parsolid.campaign.coarsening import parsed
from parsolid.campaign.estimate import Bar
from parsolid.campaign.orders import ENERGY, REACTION, STRESS, kind_of
from parsolid.scene import Scene
from parsolid.scene.observation import STORED_ENERGY

NAME, QUANTITY = "recovery", "element_variation"
COLUMN = f"{NAME}.{QUANTITY}"
# factors of E/W, and its power
_FACTORS = {ENERGY: (1.1, 1.0), REACTION: (1.1, 1.0), STRESS: (0.6, 0.5)}


def watched(scene: Scene, trust_code: bool) -> Scene | None:
    """The scene with a probe of what the estimate needs; None where it is not one of equilibria of hyperelastic meshes
    with the weights of their elements and a stabiliser that meet nothing."""
    settings: list[Any] = [system.settings for system in scene.systems]
    if scene.contact or scene.tools or scene.stages or any(one.kind != "tlsph" for one in settings):
        return None
    if any(one.integrator != "static" for one in settings):
        return None
    if any(one.pair_weights not in ("mesh", "best") or one.stabilisation == 0.0 for one in settings):
        return None
    if any(body.shape.kind != "mesh" or body.material.kind == "elastic-plastic" for body in scene.bodies):
        return None
    if any(probe.name == NAME for probe in scene.probes):
        return scene
    tables = scene.resolved()
    tables["probes"] = [*tables.get("probes", []), {"name": NAME, "quantity": QUANTITY}]
    return parsed(tables, trust_code, 1.0)


def recovery_bars(scene: Scene, times: np.ndarray, columns: dict[str, np.ndarray]) -> dict[str, Bar]:
    """The bar of each column over time that has one, from the column of the probe."""
    stored = next(columns[name] for name in STORED_ENERGY if name in columns)
    most = np.maximum.accumulate(np.abs(stored))
    beyond = np.maximum.accumulate(np.abs(columns[COLUMN]))
    share = np.minimum(np.divide(beyond, most, out=np.ones_like(most), where=most > 0.0), 1.0)
    verdict = f"by recovery, elements store {100.0 * float(share[-1]):.2g} % beyond the gradients at their nodes"
    bars = {}
    for name, values in columns.items():
        kind = kind_of(name, scene)
        if kind == STRESS and "nodal" not in name:
            # of particles, means around them
            continue
        if name != COLUMN and kind in _FACTORS and np.isfinite(values).all():
            factor, power = _FACTORS[kind]
            error = factor * share**power * np.maximum.accumulate(np.abs(values))
            bars[name] = Bar(error, None, 2.0 * power, factor, verdict)
    return bars
