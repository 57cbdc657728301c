"""Interactions of particles: neighbour lists, corrections, the two passes."""
