"""Particle methods, one file each."""
