"""Pictures of a run: sizes, contents, messages; and the fields file as pyvista reads it."""

import argparse
import base64
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from mpi4py import MPI
from solids import tables

from parsolid.api import pictures
from parsolid.commands.cli import main
from parsolid.commands.plot import add_arguments, run_plot
from parsolid.commands.plot.scales import scale_of
from parsolid.commands.view import add_arguments as add_view_arguments
from parsolid.commands.view import run_view
from parsolid.output.errors import OutputError
from parsolid.particles.skins import Skin
from parsolid.scene import SceneError

pytest.importorskip("matplotlib")
pytest.importorskip("pyvista")
from PIL import Image

# one rank draws, and tells the others of an error
pytestmark = pytest.mark.serial
RUBBER = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.3}
# shape, particles, velocity, place of the probe
SHAPES = {
    "plate": ({"box": {"lower": [0, 0], "upper": [1, 1]}}, [7, 7], ["0", "-30*Y"], [1, 1]),
    "block": ({"box": {"lower": [0, 0, 0], "upper": [1, 2, 1]}}, [4, 7, 4], ["0", "-30*Y", "0"], [1, 2, 1]),
    "ball": ({"sphere": {"centre": [0, 0, 0], "radius": 1}}, [6, 6, 6], ["0", "0", "-30*Z"], [0, 0, 0.9]),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A small run of each shape, made by all ranks."""
    root = Path(MPI.COMM_WORLD.bcast(str(tmp_path_factory.mktemp("plot"))))
    for kind, (shape, particles, velocity, at) in SHAPES.items():
        scene, probe = root / f"{kind}.toml", {"name": "corner", "at": at, "fields": ["displacement", "pressure"]}
        if MPI.COMM_WORLD.rank == 0:
            body, method = {"shape": shape, "velocity": velocity}, {"integrator": "leapfrog"}
            more = {"title": f"Small {kind}", "output": {"pictures": False, "fields_times": [0.0, 1e-4]}}
            data = tables(particles, material=RUBBER, end_time=2e-4, method=method, body=body, probes=[probe], **more)
            scene.write_text(tomli_w.dumps(data))
        MPI.COMM_WORLD.Barrier()
        assert main([str(scene), "-o", str(root / kind), "-q"]) == 0
    return root


def options_of(*arguments):
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_arguments(parser)
    return parser.parse_args([str(argument) for argument in arguments])


def draw(comm, *arguments):
    assert run_plot(comm, options_of(*arguments)) == 0


def pixels(path):
    image = Image.open(path)
    assert image.format == "PNG"
    return np.asarray(image.convert("RGB"))


def is_coloured(image):
    """Whether a good part of the picture is neither white nor grey."""
    spread = image.max(axis=2).astype(int) - image.min(axis=2)
    return np.mean(spread > 40) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plate", "ball"])
def test_standard_set(comm, folders, kind):
    """As a run draws it, and by its own command without a display, of which nothing is said."""
    folder = folders / kind
    if kind == "plate":
        pictures.draw(folder)
    else:
        command = [sys.executable, "-m", "parsolid.commands.plot", str(folder)]
        environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
        environment["MPI4PY_RC_INITIALIZE"] = "false"
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    found = sorted(path.name for path in (folder / "pictures").iterdir())
    assert found == ["energies.png", "probes.png", "von_mises_stress.png"]
    for name in ("energies.png", "probes.png"):
        assert np.mean(pixels(folder / "pictures" / name) < 128) > 0.005
    assert is_coloured(pixels(folder / "pictures" / "von_mises_stress.png"))


SIZE = ("--size", "640x320")
SHEETS = {
    "plate": ("--field", "velocity"),
    "block": ("--field", "displacement_y"),
    "ball": ("--field", "volume"),
    "plate along Y": ("--along", "Y", "--field", "velocity_x"),
}


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_has_the_size_asked_for_and_is_the_same_twice(comm, folders, name):
    outs = [folders / f"{name}-{n}.png" for n in range(3)]
    for out, more in zip(outs, ((), (), ("--times", "1e-4"))):
        draw(comm, folders / name.split()[0], *SHEETS[name], *SIZE, *more, "-o", out)
    first, second, other = map(pixels, outs)
    assert first.shape == (320, 640, 3) and np.array_equal(first, second) and not np.array_equal(first, other)
    assert is_coloured(first) if "along" not in name else np.mean(first.max(axis=2) < 128) > 0.002


@pytest.mark.slow
def test_single_pictures_small_ones_and_animations_show_every_time(comm, folders):
    out, motion = folders / "singles", folders / "motion.gif"
    draw(comm, folders / "plate", "--field", "pressure", "--single", "--small", "-o", out)
    draw(
        comm, folders / "block", "--animation", "--mirror", "XZ", "--exaggerate", "3", "--size", "240x240", "-o", motion
    )
    names = sorted(path.name for path in out.glob("pressure-*"))
    assert names == ["pressure-0.0001s.png", "pressure-0.0002s.png", "pressure-0s.png"]
    assert all(Image.open(out / name).mode == "P" for name in names)
    image = Image.open(motion)
    assert image.format == "GIF" and image.n_frames == 3 and image.size == (240, 240)


@pytest.mark.mpi
@pytest.mark.parametrize(
    "arguments, expected",
    [
        (["--field", "presure"], "'pressure'"),
        (["--field", "velocity_z"], "--field: "),
        (["--times", "0.5"], "--times: "),
        (["--times", "0", "--every"], "--times, --every: "),
        (["-o", "picture.bmp"], "--output: "),
        (["--colours", "virridis"], "'viridis'"),
        (["--single", "-o", "one.png"], "--single: "),
        (["--animation", "-o", "one.png"], "--animation: "),
        (["--size", "60x60", "-o", "one.png"], "--size: "),
        (["--along", "Z", "-o", "out.png"], "--along: "),
        (["--slice", "X = 0", "-o", "out.png"], "--slice: "),
        (["--only", "plate", "-o", "out.png"], "--only: "),
        (["--only", "plate", "-o", "."], "--only: "),
        (["--mirror", "Z", "-o", "."], "--mirror: "),
        (["--clip", "Y > 9", "-o", "."], "--clip, --slice: "),
        (["--along", "X", "--exaggerate", "2", "-o", "."], "--exaggerate: "),
        (["--view", "top", "-o", "."], "--view: "),
        (["--frames-per-second", "9", "-o", "."], "--frames-per-second: "),
    ],
)
def test_bad_input_is_told_in_one_line(comm, folders, monkeypatch, tmp_path, arguments, expected):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError) as caught:
        run_plot(comm, options_of(folders / "plate", *arguments))
    assert expected in str(caught.value) and "\n" not in str(caught.value)
    assert not list(tmp_path.glob("*.png"))
    with pytest.raises(SceneError):
        run_plot(comm, options_of(tmp_path))


def test_a_damaged_summary_is_told_of(comm, folders, tmp_path):
    if comm.size == 1:
        shutil.copytree(folders / "plate", tmp_path / "damaged")
        (tmp_path / "damaged" / "summary.json").write_text("{")
        with pytest.raises(OutputError):
            run_plot(comm, options_of(tmp_path / "damaged"))


@pytest.mark.parametrize(
    "option",
    [
        "--view=0,0,0",
        "--range=2,1",
        "--size=12",
        "--times=soon",
        "--mirror=XX",
        "--columns=0",
        "--frames-per-second=1e-9",
    ],
)
def test_options_that_are_no_values_are_refused(option):
    with pytest.raises(argparse.ArgumentError, match="expected"):
        options_of("folder", option)


def test_cells_are_continued_to_the_surface_linearly_or_not_at_all():
    skin = Skin(0, 8, [], cells=((4, False), (2, False)))
    centre = np.stack(np.meshgrid([0.5, 1.5, 2.5, 3.5], [0.5, 1.5], indexing="ij"), axis=-1).reshape(-1, 2)
    corner = np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0), indexing="ij"), axis=-1).reshape(-1, 2)
    stretch = np.array([[1.2, 0.3], [-0.1, 0.8]])
    assert np.allclose(skin.points(centre @ stretch, linear=True), corner @ stretch, atol=1e-14)
    field = skin.points(centre[:, 0], linear=False)
    assert (field.min(), field.max()) == (0.5, 3.5)


@pytest.mark.parametrize(
    "name, largest, unit, one_map",
    [
        ("pressure", 2e6, "[MPa]", True),
        ("stress_xy", 2e-6, "[10⁻⁶ Pa]", True),
        ("velocity_x", 300.0, "[m/s]", False),
        ("displacement", 1e-5, "[µm]", False),
    ],
)
def test_scales_have_units_and_signs(name, largest, unit, one_map):
    values = np.linspace(-largest, 0.8 * largest, 1001)
    scale = scale_of(name, [values], None)
    assert scale.label.endswith(unit)
    assert scale.lower == -scale.upper and 0.9 * largest < scale.upper <= largest
    # a quantity with a map of its own keeps it, whatever its signs
    assert (scale.colours == scale_of(name, [np.abs(values)], None).colours) == one_map
    fixed, damage = scale_of(name, [values], (-1.0, 2.0)), scale_of("damage", [np.array([0.0, 0.2])], None)
    assert (fixed.lower, fixed.upper, damage.lower, damage.upper) == (-1.0, 2.0, 0.0, 1.0)


def lit(path):
    """How many pixels of the bodies' panel are not white."""
    image = pixels(path)[:, :-110]
    return np.count_nonzero(image.min(axis=2) < 250)


@pytest.mark.slow
def test_bodies_cut_open_show_a_part(comm, folders):
    """A half of a lattice, of a plane body, of particles drawn as spheres; a section."""
    whole = {}
    for kind in SHAPES:
        for name, more in {"whole": [], "half": ["--clip", "X > 0.5" if kind != "ball" else "x < 0"]}.items():
            out = folders / f"cut-{kind}-{name}.png"
            more = [*more, "--view", "front"] if kind != "plate" else more
            draw(comm, folders / kind, "--times", "0", "--size", "400x300", *more, "-o", out)
            whole[kind, name] = lit(out)
        assert 0.3 * whole[kind, "whole"] < whole[kind, "half"] < 0.7 * whole[kind, "whole"], kind
    out = folders / "section.png"
    draw(comm, folders / "block", "--times", "0", "--view", "1,0,0", "--slice", "Y=1", "--size", "400x300", "-o", out)
    # seen from its edge
    assert lit(out) < 0.1 * whole["block", "whole"]


def test_failing_pictures_leave_a_finished_run_alone(tmp_path, capfd):
    pictures.draw_at_end(MPI.COMM_SELF, tmp_path, True, 0.0)
    assert capfd.readouterr().err.startswith("no pictures: ")


@pytest.mark.parametrize("kind, more", [("plate", []), ("ball", ["--mirror", "X"]), ("block", ["--clip", "Y > 0.9"])])
def test_a_page_holds_all_times_of_all_bodies(comm, folders, kind, more):
    out = folders / f"{kind}.html"
    parser = argparse.ArgumentParser()
    add_view_arguments(parser)
    assert run_view(comm, parser.parse_args([str(folders / kind), "--html", str(out), *more])) == 0
    page = out.read_text()
    data = json.loads(page.split('type="application/json">')[1].split("</script>")[0])
    assert data["title"] == f"Small {kind}"
    assert [frame["time"] for frame in data["frames"]] == ["t = 0 µs", "t = 100 µs", "t = 200 µs"]
    assert "http" not in page
    for frame in data["frames"]:
        assert len(frame["pieces"]) == (2 if kind == "ball" else 1)
        for piece in frame["pieces"]:
            places = np.frombuffer(base64.b64decode(piece["places"]), np.float32).reshape(-1, 3)
            assert len(places) == len(base64.b64decode(piece["values"])) and np.isfinite(places).all()
            if piece["faces"] is None:
                assert kind == "ball" and piece["diameter"] > 0.1
                continue
            faces = np.frombuffer(base64.b64decode(data["triangles"][piece["faces"]]), np.uint32)
            assert len(faces) % 3 == 0 and faces.max() < len(places)
            assert kind != "block" or places[:, 1].min() > 0.8


def test_a_window_wants_a_display(comm, folders, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    parser = argparse.ArgumentParser()
    add_view_arguments(parser)
    if sys.platform.startswith("linux"):
        with pytest.raises(SceneError, match="--html"):
            run_view(comm, parser.parse_args([str(folders / "plate")]))
