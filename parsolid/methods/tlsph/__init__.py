"""Upwind total-Lagrangian smoothed particle hydrodynamics."""
