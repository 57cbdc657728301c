"""Particle methods, one folder each: its `settings` are what a scene says, and name the class of its system."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from parsolid.methods.protocol import ParticleSystem
    from parsolid.scene.method_settings import MethodSettings


def method_class(settings: "MethodSettings | type[MethodSettings]") -> "type[ParticleSystem]":
    """The class of a method, see `methods.protocol`; loaded only when a scene uses it."""
    module, name = settings.system.split(":")
    found: type[ParticleSystem] = getattr(import_module(module), name)
    return found
