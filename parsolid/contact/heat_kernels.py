"""Heat of friction: one half of what a particle's friction takes goes to its own body, one to the other, spread by the
weights of the colour; what is left of it when a contact opens goes to its own."""

import numpy as np

from parsolid.contact.kernel import shape
from parsolid.contact.passes import distance
from parsolid.kernels import kernel


@kernel
def own_heat(owned, matter, lost, record, column, heat):
    """The share of their own friction (owned,) [J] of whole particles into heat; into the record's column what the
    other body gets, over the colour."""
    for a in range(owned):
        whole = lost[a] / matter.share[a]
        half = 0.5 if record[a, 2] > 0.0 else 0.0
        heat[a] = (1.0 - half) * whole
        record[a, column] = half * whole * record[a, 2]


@kernel
def others_heat(owned, matter, near, record, column, heat):
    """Add to heat (owned,) [J] what the friction of other bodies' particles gives."""
    x = np.zeros(3)
    for a in range(owned):
        for k in range(near.start[a], near.start[a + 1]):
            given = record[near.neighbour[k], column]
            if given != 0.0:
                q = distance(matter, near, a, k, x)
                if q < 1.0:
                    heat[a] += given * matter.constants[a, 4] * matter.volume[a] * shape(q)
