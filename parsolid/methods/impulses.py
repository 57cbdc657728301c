"""What an impulse does to a particle."""

from decomposition.compiled import compiled


@compiled(error_model="numpy")
def give(rows, impulse, mass, share, held, velocity):
    """Add impulses (k, d) [N s] on the part `share` of particles, rows (k,), to their velocities (n, d) [m/s], but for
    components that are held (n, d); None: none are. Returns the kinetic energy [J] gained."""
    gained = 0.0
    for k in range(len(rows)):
        a = rows[k]
        whole = mass[a] * share[a]
        for i in range(impulse.shape[1]):
            if held is None or not held[a, i]:
                change = impulse[k, i] / whole
                gained += 0.5 * whole * change * (2.0 * velocity[a, i] + change)
                velocity[a, i] += change
    return gained
