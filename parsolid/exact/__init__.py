"""Closed-form solutions, for scenes, tests and studies alike."""

from parsolid.exact.heat import CosineMode, DelayedMode, DelayedPulse, HeatedSlab, PlasticLayer
from parsolid.exact.linear_viscoelastic import BarVibration, UniaxialCreep
from parsolid.exact.manufactured import AxisAligned, GeneralisedVortex
from parsolid.exact.micro_inertia import ElasticImpact, FreeMicroWave, MicroLayer, MicroWave
from parsolid.exact.shock import SteadyShock
from parsolid.exact.viscoelastic_plate import ViscoelasticPlate

SOLUTIONS = {
    "viscoelastic-plate": ViscoelasticPlate,
    "axis-aligned": AxisAligned,
    "generalised-vortex": GeneralisedVortex,
    "cosine-mode": CosineMode,
    "heated-slab": HeatedSlab,
    "plastic-layer": PlasticLayer,
    "steady-shock": SteadyShock,
    "uniaxial-creep": UniaxialCreep,
    "bar-vibration": BarVibration,
    "delayed-heat-mode": DelayedMode,
    "delayed-heat-pulse": DelayedPulse,
    "elastic-impact": ElasticImpact,
    "micro-wave": MicroWave,
    "free-micro-wave": FreeMicroWave,
    "micro-layer": MicroLayer,
}
