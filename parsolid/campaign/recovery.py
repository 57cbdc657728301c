"""Error bars of equilibria of imported meshes from a single run, by recovery of gradients.

The gradient at a node is the mean over the elements around it. Let E be the energy that the elements store beyond that
of these mean gradients, and W the strain energy: E/W is the square of the relative energy error of linear elements
(Zienkiewicz and Zhu, Int. J. Numer. Meth. Eng. 33 (1992) 1331), and errors of this method fall with it. Errors of
energies and forces are a factor times E/W, of nodal stresses a factor times its root; with these factors 95 of 100
values lie within their bars (docs/error-bars.md). Displacements and motions have no such bar: their errors over E/W
differ between parts by factors of ten and more.
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


def with_recovery_probe(scene: Scene, trust_code: bool) -> Scene | None:
    """The scene with the probe that the estimate needs.

    None unless the scene holds equilibria of hyperelastic meshes with weights of their elements and a stabilisation,
    without contact and tools.
    """
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
    """Bars of energies, forces and nodal stresses over times (n,) [s], from the column of the probe."""
    stored = next(columns[name] for name in STORED_ENERGY if name in columns)
    most = np.maximum.accumulate(np.abs(stored))
    beyond = np.maximum.accumulate(np.abs(columns[COLUMN]))
    share = np.minimum(np.divide(beyond, most, out=np.ones_like(most), where=most > 0.0), 1.0)
    verdict = f"by recovery, elements store {100.0 * float(share[-1]):.2g} % beyond the gradients at their nodes"
    bars = {}
    for name, values in columns.items():
        kind = kind_of(name, scene)
        if kind == STRESS and "nodal" not in name:
            # a mean around a particle, not a nodal stress
            continue
        if name != COLUMN and kind in _FACTORS and np.isfinite(values).all():
            factor, power = _FACTORS[kind]
            error = factor * share**power * np.maximum.accumulate(np.abs(values))
            bars[name] = Bar(error, None, 2.0 * power, factor, verdict)
    return bars
