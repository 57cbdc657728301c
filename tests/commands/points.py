"""Material points stated as TOML, driven along their paths."""

from types import SimpleNamespace

import numpy as np

from parsolid.materials.registry import law_of
from parsolid.point.driver import integrate, point_law, tabulate


def followed(point) -> SimpleNamespace:
    """The point, its law, its record and its columns."""
    law = point_law(law_of(point.material), **point.conditions)
    record = integrate(law, point.path, point.end_time, point.longest_step)
    columns = tabulate(law, record, np.array(point.output.directions))
    return SimpleNamespace(point=point, law=law, columns=columns, **columns)
