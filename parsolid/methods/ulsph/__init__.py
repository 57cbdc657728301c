"""Updated-Lagrangian SPH: neighbours that change, plastic flow with micro-inertia (Rahaman et al.) or of other laws."""
