"""Pictures of studies and of choices: each curve of a panel has a name, a marker and a colour that no other has."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from parsolid.campaign.pictures import MOST_CURVES, _labelled, _looks, _panels, label_decades
from parsolid.commands.plot.plane import _particles
from parsolid.commands.plot.scales import scale_of
from parsolid.commands.plot.sheets import _save
from parsolid.output.words import labelled, unit_of, words_of

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


def test_the_scene_and_the_envelope_are_among_the_choices_that_are_named():
    many = [SimpleNamespace(errors=[0.3, 0.1 * number]) for number in range(12)]
    many.append(SimpleNamespace(errors=[]))
    best = many[11]
    shown, others = _labelled(SimpleNamespace(configurations=many), [(1.0, 0.3, best, 0)])
    assert shown[:2] == [many[0], best] and len(shown) == MOST_CURVES
    assert shown[2:] == many[1 : MOST_CURVES - 1] and others == many[MOST_CURVES - 1 : 11]


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("von_mises_stress", "von Mises stress [Pa]"),
        ("first_piola_kirchhoff_stress_xx", "first Piola-Kirchhoff stress xx [Pa]"),
        ("stress_xy", "stress xy [Pa]"),
        ("material_dissipation", "material dissipation"),
        ("mode_1.displacement_x", "displacement x, mode 1 [m]"),
        ("rod.upper_bounds_y", "upper bounds y, rod [m]"),
        ("damage", "damage"),
    ],
)
def test_one_way_to_write_a_quantity(name, label):
    assert labelled(words_of(name), unit_of(name.rpartition(".")[2])) == label


def test_particles_are_squares_that_meet_whatever_their_order_and_the_paper_is_white(tmp_path):
    values, position = np.array([0.0, 1.0]), np.array([[0.5, 0.5], [1.5, 0.5]])
    images = []
    for order in ([0, 1], [1, 0]):
        figure = Figure(figsize=(4.0, 2.0), dpi=50)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1), xlim=(-1.0, 3.0), ylim=(-0.5, 1.5))
        axes.set_axis_off()
        scale, limits = scale_of("damage", [values], None), Normalize(0.0, 1.0)
        _particles(axes, position[order], values[order], np.ones(2), limits, scale)
        _save(figure, tmp_path / "small.png", small=True)
        images.append(np.asarray(Image.open(tmp_path / "small.png").convert("RGB")).astype(int))
    assert (images[0] == images[1]).all()
    row = images[0][50]
    # half of the width is theirs, and beside them is nothing
    assert (row[[5, 45, 155, 195]] == 255).all() and (row[60:140] < 255).any(axis=1).all()
    assert row[70, 1] > 200 > row[130, 1]


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
