"""Power of the stresses of particles, for the ledger."""

from decomposition.compiled import compiled


@compiled(error_model="numpy")
def power(owned, stress, rate):
    """sum_p V sigma : l [W] of particles 0..owned-1; stress (capacity, 8) and rate (capacity, 12) as in
    `plastic_update.advance_stress`.
    """
    total = 0.0
    for p in range(owned):
        total += stress[p, 0] * rate[p, 0] + stress[p, 1] * rate[p, 5] + stress[p, 2] * rate[p, 10]
        total += stress[p, 4] * (rate[p, 6] + rate[p, 9]) + stress[p, 5] * (rate[p, 2] + rate[p, 8])
        total += stress[p, 6] * (rate[p, 1] + rate[p, 4])
    return total


@compiled(error_model="numpy")
def power_at_end(owned, stress, rate, step):
    """As `power`, with gradients by the places at the end of a step [s], l (1 + dt l)^-1."""
    total = 0.0
    for p in range(owned):
        a, b, c = 1.0 + step * rate[p, 0], step * rate[p, 1], step * rate[p, 2]
        d, e, f = step * rate[p, 4], 1.0 + step * rate[p, 5], step * rate[p, 6]
        g, h, i = step * rate[p, 8], step * rate[p, 9], 1.0 + step * rate[p, 10]
        # dt l (1 + dt l)^-1 = 1 - (1 + dt l)^-1
        det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        whole = stress[p, 0] + stress[p, 1] + stress[p, 2]
        part = stress[p, 0] * (e * i - f * h) + stress[p, 1] * (a * i - c * g) + stress[p, 2] * (a * e - b * d)
        part += stress[p, 4] * (c * d - a * f + b * g - a * h)
        part += stress[p, 5] * (b * f - c * e + d * h - e * g)
        part += stress[p, 6] * (c * h - b * i + f * g - d * i)
        total += whole - part / det
    return total / step
