"""Pictures of forces against displacements, and of what contact and supports write to a history."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from matplotlib.figure import Figure

from parsolid.commands.plot.curves import pairs, write_energies, write_forces, write_probes
from parsolid.output.results import Results

TOLD = {"kind": "velocity", "where": "top", "name": "pull", "reaction": True}
MOVED = {"name": "grip", "where": "top", "fields": ["stress", "displacement"]}
COLUMNS = ["time", "grip.displacement_x", "grip.displacement_y", "pull.force_x", "pull.force_y", "pull.moment"]


@pytest.mark.parametrize(
    ("boundary", "probe", "found"),
    [
        (TOLD, MOVED, ["x", "y"]),
        (TOLD | {"reaction": False}, MOVED, []),
        (TOLD, MOVED | {"where": "foot"}, []),
        (TOLD, MOVED | {"fields": ["stress"]}, []),
    ],
)
def test_a_force_goes_with_the_displacement_of_its_region(boundary, probe, found, tmp_path):
    tables = {"boundaries": [{"kind": "fixed", "plane": "Y = 0"}, boundary], "probes": [probe]}
    wanted = {"pull": [(f"grip.displacement_{a}", f"pull.force_{a}") for a in found]} if found else {}
    assert pairs(tables, COLUMNS) == wanted
    history = {name: np.linspace(0.0, 1.0, 5) for name in COLUMNS}
    results = SimpleNamespace(columns=history, scene=tables, title="pulled", dimension=2, per=lambda name: "/m")
    assert write_forces(results, tmp_path / "forces.png") == bool(found) == (tmp_path / "forces.png").is_file()


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """Panels of the pictures of a run with contact: (drawing function, more of the scene) -> label -> legends."""

    def draw(write, scene="dimension = 2", **more):
        rows = {
            "step": 2,
            "time": 1.0,
            "dt": 0.5,
            "kinetic": 90.0,
            "strain_energy": 60.0,
            "material_dissipation": 9.0,
        } | dict.fromkeys(("numerical_dissipation", "external_work"), 0.0)
        rows |= {"contact_energy": 5.0, "viscous_work": 1e-3, "friction_dissipation": 0.2, "energy_error": 0.0}
        rows |= {"foot.work": 0.0, "foot.force_x": 2.5e4, "foot.force_y": 1e4, "foot.moment": 7.0, "ball.force_x": 3.0}
        rows |= more
        lines = [",".join(rows)] + [",".join(f"{value * k:g}" for value in rows.values()) for k in (0, 0.5, 1)]
        (tmp_path / "history.csv").write_text("\n".join(lines) + "\n")
        (tmp_path / "scene.toml").write_text(scene)
        figures = []
        monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
        write(Results(tmp_path), tmp_path / "picture.png")
        return {
            f"{axes.get_title()} {axes.get_ylabel()}".strip(): axes.get_legend_handles_labels()[1]
            for axes in figures[0].axes
            if axes.get_visible()
        }

    return draw


def test_what_contact_stores_is_not_drawn_as_dissipated_and_nothing_as_a_line_of_zeros(drawn):
    assert drawn(write_energies) == {
        "energy [J]": ["kinetic energy", "strain energy", "kinetic + strain energy", "contact energy"],
        "dissipated [J]": ["material dissipation", "friction dissipation"],
        "energy error / largest energy": [],
    }


def test_bodies_that_press_at_the_start_and_part_have_stored_no_less_than_nothing(drawn):
    assert drawn(write_energies, contact_energy=-5.0)["energy [J]"][-1] == "change of contact energy"


def test_forces_of_supports_and_tools_have_units_and_idle_supports_no_work(drawn):
    assert list(drawn(write_probes)) == ["foot force [kN/m]", "foot moment [N m/m]", "ball force [kN/m]"]
    assert list(drawn(write_probes, "dimension = 3"))[:2] == ["foot force [kN]", "foot moment [N m]"]
    around = 'dimension = 2\n[method]\ngeometry = "axisymmetric"\n[[tools]]\nname = "ball"'
    told = ["foot force [kN/rad]", "foot moment [N m/rad]", "ball force [kN]"]
    assert list(drawn(write_probes, around)) == told
