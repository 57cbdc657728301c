"""What particles of elastic-plastic laws carry in the material point method, and a scene may name."""

from functools import partial

from parsolid.particles.declaration import Columns, Field

_kept = partial(Field, checkpointed=True, layout=Columns())
PLASTIC_STATE = (
    _kept("plastic_strain", 1, "1"),
    _kept("internal_energy", 1, "J/m^3"),
    _kept("temperature", 1, "K"),
)
