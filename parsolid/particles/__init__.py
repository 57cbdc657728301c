"""Particles of a rank: declared fields, generation, distribution."""
