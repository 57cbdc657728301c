"""Hyperelastic laws and what follows from them."""
