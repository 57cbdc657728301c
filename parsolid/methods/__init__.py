"""Particle methods, one file each."""

from parsolid.methods.tlsph import TotalLagrangianSPH

METHODS = {"tlsph": TotalLagrangianSPH}
