"""Scenes: what a TOML file may say, and the particles, fields and regions that it means."""

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.initial import (
    initial_deformation_gradient,
    initial_displacement,
    initial_temperature,
    initial_velocity,
)
from parsolid.scene.loading import dump_scene, load_scene, packaged_scene, parse_scene
from parsolid.scene.regions import nearest_particles, selected
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import SceneError, agree

__all__ = [
    "ParticleSet",
    "Scene",
    "SceneError",
    "agree",
    "dump_scene",
    "initial_deformation_gradient",
    "initial_displacement",
    "initial_temperature",
    "initial_velocity",
    "load_scene",
    "nearest_particles",
    "packaged_scene",
    "parse_scene",
    "selected",
]
