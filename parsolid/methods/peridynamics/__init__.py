"""Correspondence and bond-based peridynamics."""
