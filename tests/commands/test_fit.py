"""Parameters of laws from measured curves: those that made the data come back, and Treloar's rubber."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.commands import fit as command
from parsolid.commands.cli import main
from parsolid.point.fit import KINDS, Measured, fit, law_with, nominal_stress

TRELOAR = Path(__file__).parents[2] / "docs" / "treloar.csv"
STRETCH = np.linspace(1.05, 4.0, 12)


def made(kind, values, noise=0.0):
    law, random = law_with(kind, values), np.random.default_rng(4)
    stresses = [nominal_stress(law, one, STRETCH) for one in KINDS]
    return [
        Measured(one, STRETCH, s + noise * np.abs(s).max() * random.normal(size=len(s)))
        for one, s in zip(KINDS, stresses)
    ]


def test_nominal_stresses_are_those_of_the_closed_forms():
    """Of mu/2 (I1bar - 3): mu (a - a^-2), mu (a - a^-5), mu (a - a^-3)."""
    law, a = law_with("yeoh", {"c1": 0.5e6}), STRETCH
    for kind, power in (("uniaxial", -2), ("equibiaxial", -5), ("pure-shear", -3)):
        np.testing.assert_allclose(nominal_stress(law, kind, a), 1e6 * (a - a ** float(power)), rtol=1e-12)
    # a twisted cylinder has the torque pi/2 mu R^3 at the shear 1 of its surface, whatever the shear
    np.testing.assert_allclose(nominal_stress(law, "torsion", a), 0.5 * np.pi * 1e6 * a, rtol=1e-12)
    # of c10 (I1bar - 3) + c20 (I1bar - 3)^2: 2 (c10 + 2 c20 g^2) g (Rivlin, Phil. Trans. R. Soc. A 242 (1949) 173)
    law, g = law_with("yeoh", {"c1": 0.5e6, "c2": 2e4}), np.array([-0.5, 0.0, 2.0])
    expected = 2.0 * np.pi * (2.0 * 0.5e6 * g / 4.0 + 4.0 * 2e4 * g**3 / 6.0)
    np.testing.assert_allclose(nominal_stress(law, "torsion", g), expected, rtol=1e-12, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("yeoh", {"c1": 0.17e6, "c2": -1.5e3, "c3": 50.0}),
        ("gent", {"shear_modulus": 0.3e6, "limit": 90.0}),
        ("polynomial", {"c10": 0.15e6, "c01": 0.02e6, "c20": 1e3, "c11": 0.0, "c02": 0.0, "c30": 0.0}),
        ("mooney-rivlin", {"xi": 0.15e6, "zeta": 0.02e6}),
        ("neo-hookean", {"xi": 0.2e6}),
    ],
)
def test_parameters_that_made_the_data_come_back(kind, values):
    found = fit(kind, made(kind, values), {name: 0.0 for name, value in values.items() if value == 0.0})
    for name, value in zip(found.names, found.values):
        assert value == pytest.approx(values[name], rel=1e-4), name
    assert found.error < 1e-6


def test_a_compression_test_alone():
    """Its stretches are below 1, the first is 1."""
    a = np.linspace(1.0, 0.6, 6)
    test = Measured("uniaxial", a, nominal_stress(law_with("yeoh", {"c1": 0.2e6}), "uniaxial", a))
    assert fit("yeoh", [test], {"c2": 0.0, "c3": 0.0}).values == pytest.approx([0.2e6], rel=1e-4)


def test_intervals_hold_the_parameters_behind_noise():
    values = {"shear_modulus": 0.3e6, "limit": 60.0}
    found = fit("gent", made("gent", values, noise=0.01), {})
    for name, value, spread in zip(found.names, found.values, found.spread):
        assert 0.0 < spread < 0.2 * value and abs(value - values[name]) < 2.0 * spread


def test_treloars_rubber(capsys, tmp_path):
    """Three tests at once: Gent's two constants, within 5 % of the largest stress of each test."""
    assert main(["fit", str(TRELOAR), "--law", "gent", "-o", str(tmp_path / "curve.csv")]) == 0
    told = dict(line.split(" = ") for line in capsys.readouterr().out.splitlines() if " = " in line)
    assert float(told["shear_modulus"].split()[0]) == pytest.approx(0.29e6, rel=0.05)
    assert float(told["limit"].split()[0]) == pytest.approx(88.0, rel=0.05)
    assert len((tmp_path / "curve.csv").read_text().splitlines()) == 1 + sum(
        len(one.stretch) for one in command.read_tests(str(TRELOAR))[0]
    )


def test_branches_of_held_sheets_come_back(tmp_path, capsys):
    """Relaxing as two branches with a decade between, of which the times that are told have others, too."""
    law, held, time = law_with("yeoh", {"c1": 0.2e6}), 1.5, np.geomspace(0.1, 100.0, 31)
    slow = np.array([1.2, 1.5, 2.0])
    rows = [f"uniaxial,{a},{s!r}," for a, s in zip(slow, nominal_stress(law, "uniaxial", slow).tolist())]
    above = (held - held**-2) * (1e5 * np.exp(-time) + 3e5 * np.exp(-time / 10.0))
    stresses = nominal_stress(law, "uniaxial", np.array([held])) + above
    rows += [f"uniaxial,{held},{s!r},{t!r}" for t, s in zip(time.tolist(), stresses.tolist())]
    data = tmp_path / "held.csv"
    data.write_text("\n".join(["kind,stretch,stress,time", *rows]))
    assert main(["fit", str(data), "--law", "yeoh", "--fix", "c2=0", "--fix", "c3=0"]) == 0
    (told,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("branches"))
    found = tomllib.loads(told)["branches"]
    assert [one["tau"] for one in found] == pytest.approx([1.0, 10.0])
    assert [one["modulus"] for one in found] == pytest.approx([1e5, 3e5], rel=1e-4)


ROW = "kind,stretch,stress\nuniaxial,1.5,1e5\n"


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        (ROW, "rubber"),
        (ROW, "yeoh"),
        (ROW, "neo-hookean -o DATA"),
        (ROW, "gasser-ogden-holzapfel --angle 1e9"),
        (ROW, "mooney-rivlin --fix xi=1 --fix xi=2"),
        (ROW + "uniaxial,2,2e5,7\n", "neo-hookean"),
        (ROW.replace("kind", "stretch"), "neo-hookean"),
        (ROW, "saint-venant-kirchhoff"),
        (ROW, "guccione"),
        (ROW, "yeoh --fix c9=1"),
        (ROW, "yeoh --fix c2=x"),
        (ROW, "yeoh -o missing/curve.csv"),
        (ROW, "yeoh --angle 10"),
        (ROW.replace("uniaxial", "bending"), "yeoh"),
        (ROW.replace("1.5", "-1.5"), "yeoh"),
        (ROW.replace("1.5", "wide"), "yeoh"),
        (ROW + "pure-shear,1.5,0\n", "gent"),
        (ROW.replace("uniaxial,1.5", "torsion,0.5"), "guccione --angle 0"),
        (ROW.replace("uniaxial,1.5", "torsion,0"), "yeoh"),
        ("kind,stretch\nuniaxial,1.5\n", "yeoh"),
        ("kind,stretch,stress\n", "yeoh"),
        ("kind,stretch,stress,time\nuniaxial,1.5,1e5,1\n", "yeoh"),
        ("kind,stretch,stress,time\nuniaxial,1.5,1e5,\nuniaxial,1.5,1e5,-1\n", "yeoh"),
    ],
)
def test_data_and_laws_that_are_none_are_refused(tmp_path, capsys, text, arguments):
    data = tmp_path / "data.csv"
    data.write_text(text)
    assert main(["fit", str(data), "--law", *arguments.replace("DATA", str(data)).split()]) == 2
    assert data.read_text() == text
    assert MPI.COMM_WORLD.rank > 0 or "expected" in capsys.readouterr().err


def test_fibres_at_an_angle_come_back_and_make_free_stretches_unequal():
    """A sheet with two families; pulled between them it narrows less across the sheet than along it."""
    values, angle = {"shear_modulus": 2e4, "fibre_modulus": 5e4, "fibre_exponent": 3.0}, 30.0
    law, a = law_with("holzapfel-gasser-ogden", values, angle), np.array([1.1, 1.2, 1.3])
    assert law.fibre == pytest.approx((np.cos(np.pi / 6.0), 0.5, 0.0)) and law.second_fibre[1] == -law.fibre[1]
    tests = [Measured(kind, a, nominal_stress(law, kind, a)) for kind in ("uniaxial", "pure-shear")]
    found = fit("holzapfel-gasser-ogden", tests, {"fibre_exponent": 3.0}, angle)
    for name, value in zip(found.names, found.values):
        assert value == pytest.approx(values[name], rel=1e-4), name
