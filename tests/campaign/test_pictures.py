"""Pictures of studies and of choices: each curve of a panel has a name, a marker and a colour that no other has."""

from types import SimpleNamespace

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.campaign.pictures import MOST_CURVES, _looks, _panels, label_decades

TIMES = ["velocity@0.1", "velocity@0.2"]
PROBES = ["corner.displacement_x", "corner.displacement_y"]

# one that agrees with another
AGREES = "edge.displacement_x"


def line(name, **errors):
    return [SimpleNamespace(line=(name,), measures={"errors": errors})]


def test_no_two_curves_of_a_panel_look_alike_and_none_has_too_many():
    lines = [line(f"scene {number}", kinetic=0.1 * number) for number in range(1, 12)]
    plate = dict(zip([*TIMES, *PROBES, AGREES], [0.1, 0.2, 0.3, 0.4, 0.301]))
    lines += [line("plate", **plate), line("bar", **{PROBES[0]: 0.2, PROBES[1]: 0.2, "kinetic": 0.0})]
    panels = _panels(lines, ["kinetic", *TIMES, *PROBES, AGREES])
    assert [(title, len(curves)) for title, curves in panels] == [
        ("kinetic energy (1 of 2)", 5),
        ("kinetic energy (2 of 2)", 6),
        ("velocity", 2),
        ("probe", 3),
    ]
    looks = _looks([curve for _, curves in panels for curve in curves])
    for _, curves in panels:
        assert len({tuple(looks[curve.text].values()) for curve in curves}) == len(curves) <= MOST_CURVES
    names = [curve.text for curve in panels[-1][1]]
    assert names == ["plate, displacement x, corner", "plate, displacement y, corner", "bar"]


@pytest.mark.parametrize(("high", "labels"), [(290.0, ["1", "2", "5", "10", "20"]), (310.0, ["1", "10", "100"])])
def test_a_logarithmic_axis_has_labels_at_1_2_and_5_or_at_1_where_it_spans_many_decades(high, labels):
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xscale="log", xlim=(1.0, high))
    label_decades(axes.xaxis)
    figure.canvas.draw()
    shown = [one.get_text() for one in axes.get_xticklabels() if 1.0 <= float(one.get_text()) <= high]
    assert shown[: len(labels)] == labels
