"""Boundary conditions and loads, translated once for all methods.

`declarations` holds what a scene's conditions mean, without any particles; the rest brings it to the particles of a
rank: mirror planes and clamps (`supports`, `mirror_planes`), prescribed motion (`prescribed`), loads (`loads`), heat
(`heat`).
"""
