"""What the registry finds; what holds for every law is in `contracts.test_laws`."""

from pathlib import Path

from parsolid.materials import registry
from parsolid.materials.declaration import ROLES, parameters_of
from parsolid.scene import load_scene

DEMIRAY = f"{Path(__file__).parents[2] / 'examples' / 'demiray.py'}:Demiray"


def test_every_declared_parameter_of_every_law_has_a_unit_and_every_kind_a_table():
    for role in ROLES:
        assert registry.kinds(role)
        for kind in registry.kinds(role):
            declared = registry.declared(role, kind)
            assert (declared.role, declared.kind) == (role, kind) and declared.__doc__
            assert all(getattr(parameter, "unit", "1") for _, parameter in parameters_of(declared).values())


def test_entry_points_are_found_by_role_and_kind(monkeypatch):
    class Point:
        name = "hyperelastic.elsewhere"

        @staticmethod
        def load():
            return registry.loaded(*DEMIRAY.rsplit(":", 1))

    path, name = DEMIRAY.rsplit(":", 1)
    registry.from_text(path, name, Path(path).read_text())
    monkeypatch.setattr(registry, "entry_points", lambda group: [Point] if group == "parsolid.laws" else [])
    registry._installed.cache_clear()
    try:
        assert "elsewhere" in registry.kinds("hyperelastic")
        assert registry.declared("hyperelastic", "elsewhere").__qualname__.endswith("Demiray")
    finally:
        registry._installed.cache_clear()


def test_no_scene_is_imported_with_numba(tmp_path):
    """Start-up: the tables of laws are made when a scene asks for them."""
    import subprocess
    import sys

    code = "import sys, parsolid.scene; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    assert load_scene is not None
