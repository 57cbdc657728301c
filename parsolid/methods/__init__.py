"""Particle methods, one folder each."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from parsolid.methods.protocol import ParticleSystem

# loaded only when a scene uses it
_CLASSES = {
    "tlsph": ("parsolid.methods.tlsph.system", "TotalLagrangianSPH"),
    "peridynamics": ("parsolid.methods.peridynamics.system", "Peridynamics"),
    "mpm": ("parsolid.methods.mpm.system", "MaterialPoint"),
}


def method_class(kind: str) -> "type[ParticleSystem]":
    """The class of a method, see `methods.protocol`."""
    module, name = _CLASSES[kind]
    found: type[ParticleSystem] = getattr(import_module(module), name)
    return found
