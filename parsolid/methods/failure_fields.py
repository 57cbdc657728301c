"""Names that go with failure: the field that scenes may name, and the terms of the ledger."""

from functools import partial

from parsolid.particles.declaration import Columns, Field

FAILURE_DISSIPATION, DELETED_KINETIC, DELETED_INTERNAL = (
    "failure_dissipation",
    "deleted_kinetic",
    "deleted_internal_energy",
)
kept_column = partial(Field, checkpointed=True, layout=Columns())
DAMAGE = kept_column("damage", 1, "1", shown=True)
