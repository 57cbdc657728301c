"""Viscoelastic laws."""
