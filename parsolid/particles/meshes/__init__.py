"""Meshes: files and what is imported of them, slices of every rank, particles on their nodes or in their elements."""
