"""Boundary conditions and loads, for all methods: see `conditions`.

conditions   all of a scene's conditions on a rank's particles, as integrators call them
loads        loads alone, with the reactions of those that report their force
forces       one class for each kind of load; surface: the particles that it acts on
motion       prescribed velocity, displacement and rotation
constraints  supports, mirror planes (`mirror_planes`), inclined rollers
walls        rigid walls; heat: sources of heat and heat through planes
reactions    force, moment and work of a condition
"""
