"""Closed-form solutions, for scenes, tests and studies alike."""

from parsolid.exact.viscoelastic_plate import ViscoelasticPlate

SOLUTIONS = {"viscoelastic-plate": ViscoelasticPlate}
