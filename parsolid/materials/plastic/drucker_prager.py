"""Soils and powders: the cone of Drucker & Prager (Q. Appl. Math. 10 (1952) 157) with a cap that compaction hardens and
a cut-off of tension (de Souza Neto, Peric & Owen, Computational Methods for Plasticity, 2008, section 8.3)."""

import math
from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import (
    cold_pressure,
    elastic_jacobian,
    flow_stress,
    isentropic_bulk_modulus,
    stress_measure,
)
from parsolid.materials.plastic.tile_update import (
    COMPACTION,
    INCREMENT,
    NEW_JACOBIAN,
    PLASTIC_VOLUME,
    SCRATCH,
    SHEAR_MODULUS,
    TRIAL,
    VOLUME_WORK,
    flow_stress_before,
    plastic_increments,
)
from parsolid.tiles import TILE

_NEVER = math.inf
# scratch rows of a tile: mean stress of the trial state and after the return, bulk modulus, sqrt(J2) after the return
_MEAN, _NEW_MEAN, _BULK, _LEFT = SCRATCH, SCRATCH + 1, SCRATCH + 2, SCRATCH + 3


@law("flow-stress", "drucker-prager")
class DruckerPrager(NamedTuple):
    """sqrt(J2) <= k - eta p, p the mean stress, eta and k those of the outer edges of Mohr & Coulomb's pyramid; -p_b <=
    p <= tension, p_b = cap_pressure exp(plastic compaction of the cap/compaction)."""

    flows_in_volume = True  # type: ignore[misc]
    friction_angle: Annotated[float, Parameter("degrees", "phi", at_least=0.0, below=90.0, factor=math.pi / 180.0)]
    dilation_angle: Annotated[
        float, Parameter("degrees", "psi, of the flow", at_least=0.0, below=90.0, default=0.0, factor=math.pi / 180.0)
    ]
    cohesion: Annotated[float, Parameter("Pa", "c", at_least=0.0)]
    tension: Annotated[
        float, Parameter("Pa", "largest mean stress; the apex of the cone unless given", at_least=0.0, default=_NEVER)
    ]
    cap_pressure: Annotated[
        float, Parameter("Pa", "p_b before any compaction; no cap unless given", above=0.0, default=_NEVER)
    ]
    compaction: Annotated[
        float, Parameter("1", "plastic volume strain by which p_b grows e-fold", above=0.0, default=_NEVER)
    ]

    def faults(self) -> list[tuple[tuple[str, ...], str, object]]:
        """Constants that do not go together."""
        result: list[tuple[tuple[str, ...], str, object]] = []
        if self.dilation_angle > self.friction_angle:
            result.append((("dilation_angle",), "at most the friction_angle", self.dilation_angle))
        if self.friction_angle == 0.0 and self.cohesion == 0.0:
            result.append((("cohesion",), "more than 0 with a friction_angle of 0", self.cohesion))
        if (self.cap_pressure == _NEVER) != (self.compaction == _NEVER):
            lacking = "compaction" if self.compaction == _NEVER else "cap_pressure"
            result.append(((lacking,), "a value: cap_pressure and compaction go together", None))
        eta, k = cone(math.radians(self.friction_angle), self.cohesion)
        if self.tension != _NEVER and self.tension * eta > k:
            result.append((("tension",), f"at most {k / eta:g}, the apex of the cone", self.tension))
        return result


@inlined
def cone(angle, cohesion):
    """(eta, k) of the cone at the outer edges of Mohr & Coulomb's pyramid: slope of sqrt(J2) over the pressure, and
    sqrt(J2) without pressure [Pa]; angle in radians."""
    below = math.sqrt(3.0) * (3.0 - math.sin(angle))
    return 6.0 * math.sin(angle) / below, 6.0 * cohesion * math.cos(angle) / below


@flow_stress.of(DruckerPrager)
def _without_pressure(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    return math.sqrt(3.0) * cone(model.friction_angle, model.cohesion)[1]


@flow_stress_before.of(DruckerPrager)
def _at_the_end(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature, returned):
    return returned


@elastic_jacobian.of(DruckerPrager)
def _elastic_part(model, J, volume):
    return J * exp(-volume)


@stress_measure.of(DruckerPrager)
def _of_kirchhoff_stress(model, J):
    return 1.0 / J, 0.0


@plastic_increments.of(DruckerPrager)
def _return_to_cone_cap_and_tension(model, law, hardening, step, tile):
    eta, k = cone(model.friction_angle, model.cohesion)
    dilation = cone(model.dilation_angle, 0.0)[0]
    apex = k / eta if eta > 0.0 else math.inf
    capped = 0
    for p in range(TILE):
        J, mu = tile[NEW_JACOBIAN * TILE + p], tile[SHEAR_MODULUS * TILE + p]
        # moduli of Kirchhoff stress are divided by J, as the tile's
        measure = mu / law.shear_modulus.modulus
        elastic = elastic_jacobian(model, J, tile[PLASTIC_VOLUME * TILE + p])
        mean = -measure * cold_pressure(law.equation_of_state, elastic)
        bulk = measure * isentropic_bulk_modulus(law.equation_of_state, elastic, -mean)
        root = tile[TRIAL * TILE + p] / math.sqrt(3.0)
        # the cone, or its apex where the return would pass it
        gamma = max(root + eta * mean - k, 0.0) / (mu + bulk * eta * dilation)
        to_apex = root - mu * gamma < 0.0
        new = apex if to_apex else mean - bulk * dilation * gamma
        left = 0.0 if to_apex else root - mu * gamma
        # beyond the cut-off or the cap, at its end and within the cone there
        cut = new > model.tension
        new = model.tension if cut else new
        left = min(root, max(k - eta * new, 0.0)) if cut else left
        tile[_MEAN * TILE + p], tile[_BULK * TILE + p], tile[_NEW_MEAN * TILE + p] = mean, bulk, new
        tile[_LEFT * TILE + p] = left
        capped += 1 if new < -model.cap_pressure * exp(tile[COMPACTION * TILE + p] / model.compaction) else 0
    if capped > 0:
        _return_to_cap(model, eta, k, tile)
    for p in range(TILE):
        root = tile[TRIAL * TILE + p] / math.sqrt(3.0)
        new = tile[_NEW_MEAN * TILE + p]
        x = (root - tile[_LEFT * TILE + p]) / (math.sqrt(3.0) * tile[SHEAR_MODULUS * TILE + p])
        opened = (tile[_MEAN * TILE + p] - new) / tile[_BULK * TILE + p]
        tile[INCREMENT * TILE + p] = max(x, 0.0)
        tile[PLASTIC_VOLUME * TILE + p] += opened
        tile[VOLUME_WORK * TILE + p] = tile[NEW_JACOBIAN * TILE + p] * new * opened


@inlined
def _return_to_cap(model, eta, k, tile):
    for p in range(TILE):
        mean, bulk = tile[_NEW_MEAN * TILE + p], tile[_BULK * TILE + p]
        present = model.cap_pressure * exp(tile[COMPACTION * TILE + p] / model.compaction)
        if mean < -present:
            compacted = cap_step(mean, bulk, present, model.compaction)
            new, root = mean + bulk * compacted, tile[TRIAL * TILE + p] / math.sqrt(3.0)
            tile[_NEW_MEAN * TILE + p], tile[_LEFT * TILE + p] = new, min(root, max(k - eta * new, 0.0))
            tile[COMPACTION * TILE + p] += compacted


@inlined
def cap_step(mean, bulk, present, compaction):
    """v of mean + bulk v = -present exp(v/compaction), mean < -present [Pa]: Newton's method in a fixed count from a
    start from which it falls; from 0 it diverges."""
    ratio = max(-mean / present, 1.0)
    v = min(compaction * log(ratio), max(-mean - present, 0.0) / bulk)
    for _ in range(6):
        grown = present * exp(min(v / compaction, 700.0))
        v -= (mean + bulk * v + grown) / (bulk + grown / compaction)
    return v
