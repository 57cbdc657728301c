"""Particle methods, one file each."""

from importlib import import_module

# loaded only when a scene uses it
_CLASSES = {
    "tlsph": ("parsolid.methods.tlsph.system", "TotalLagrangianSPH"),
    "peridynamics": ("parsolid.methods.peridynamics.system", "Peridynamics"),
    "mpm": ("parsolid.methods.mpm.system", "MaterialPoint"),
}


def method_class(kind: str) -> type:
    """The class of a method, see `methods.protocol`."""
    module, name = _CLASSES[kind]
    return getattr(import_module(module), name)
