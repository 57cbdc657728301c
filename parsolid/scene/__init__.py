"""Scenes: what a TOML file may say, and the particles, fields and regions that it means."""

from parsolid.scene.cloud import Cloud
from parsolid.scene.faults import SceneError, agree
from parsolid.scene.generation import generate
from parsolid.scene.initial import initial_deformation_gradient, initial_displacement, initial_temperature, initial_velocity
from parsolid.scene.loading import dump_scene, load_scene, packaged_scene, parse_scene
from parsolid.scene.regions import nearest_particles, selected
from parsolid.scene.schema import Scene

__all__ = [
    "Cloud",
    "Scene",
    "SceneError",
    "agree",
    "dump_scene",
    "generate",
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
