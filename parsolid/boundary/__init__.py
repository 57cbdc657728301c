"""Boundary conditions and loads, for all methods: see `conditions`.

conditions          all of a scene's conditions on a rank's particles, as integrators call them
loads_on_particles  loads alone, with their reactions
forces              one class for each kind of load; surface: the particles that it acts on
motion              prescribed velocity, displacement and rotation
constraints         supports, mirror planes (`mirror_planes`), inclined rollers
walls               rigid walls; heating: sources of heat and heat through planes
reporting           force, moment and work of a condition
"""
