"""Scenes: what a TOML file may say, and the particles, fields and regions that it means.

Names are looked up when they are first used: the settings of methods, which a scene reads, import from this package
themselves.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from parsolid.particles.particle_set import ParticleSet
    from parsolid.scene.initial import (
        initial_deformation_gradient,
        initial_displacement,
        initial_micro_rate,
        initial_plastic_strain,
        initial_temperature,
        initial_velocity,
        initial_zero_energy_temperature,
    )
    from parsolid.scene.loading import dump_scene, load_scene, packaged_scene, parse_scene
    from parsolid.scene.regions import nearest_particles, selected
    from parsolid.scene.schema import Scene
    from parsolid.scene.validation_errors import SceneError

__all__ = [
    "ParticleSet",
    "Scene",
    "SceneError",
    "dump_scene",
    "initial_deformation_gradient",
    "initial_displacement",
    "initial_micro_rate",
    "initial_plastic_strain",
    "initial_temperature",
    "initial_velocity",
    "initial_zero_energy_temperature",
    "load_scene",
    "nearest_particles",
    "packaged_scene",
    "parse_scene",
    "selected",
]

_HOMES = {
    "ParticleSet": "parsolid.particles.particle_set",
    "Scene": "parsolid.scene.schema",
    "SceneError": "parsolid.scene.validation_errors",
    "nearest_particles": "parsolid.scene.regions",
    "selected": "parsolid.scene.regions",
    **dict.fromkeys(("dump_scene", "load_scene", "packaged_scene", "parse_scene"), "parsolid.scene.loading"),
    **dict.fromkeys((name for name in __all__ if name.startswith("initial_")), "parsolid.scene.initial"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
