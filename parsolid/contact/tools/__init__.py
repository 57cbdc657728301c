"""Rigid tools that bodies touch: shapes, motion, forces."""
