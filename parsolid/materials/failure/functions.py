"""The function of criteria of failure.

A criterion is a NamedTuple under `@law("failure", kind)` with a `damage_after`, in plain arithmetic as the functions of
plastic laws (`materials.plastic.functions`).
"""

from parsolid.materials.law_functions import law_function


@law_function
def damage_after(criterion, damage, strength, loading):
    """Damage after a step, from that before it; the criterion is met at 1, and damage never falls.

    strength: factor on the strength of the particle, 1 without scatter; loading: `failure.Loading`.
    """
