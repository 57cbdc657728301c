"""Recipes of packages ask for what pyproject.toml asks for."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SPACK = ROOT / "packaging/spack/spack_repo/parsolid/packages/py_parsolid/package.py"
CONDA = ROOT / "packaging/conda/recipe.yaml"


def wanted(words):
    """Name -> least version, numbers alone."""
    found = (re.match(r"([\w-]+)\s*>=\s*([\d.]+)", word) for word in words)
    return {one[1]: [int(number) for number in one[2].split(".") if number != "0"] for one in found if one}


def in_spack(text):
    found = re.findall(r'depends_on\("(?:py-)?([\w-]+)@([\d.]+):', text)
    return {name: [int(number) for number in version.split(".") if number != "0"] for name, version in found}


@pytest.mark.serial
def test_conda_and_spack_have_the_dependencies_with_their_least_versions():
    needed = wanted([*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"])
    assert len(needed) == 10
    conda = CONDA.read_text()
    assert wanted(re.findall(r"- (.*)", conda.split("  run:")[1].split("tests:")[0])) == needed
    assert f'version: "{PROJECT["version"]}"' in conda and PROJECT["scripts"]["parsolid"] in conda
    spack = SPACK.read_text()
    plain, plotting = spack.split('with when("+plot"):')
    assert {name: version for name, version in in_spack(plain).items() if name != "setuptools"} == needed
    extra = wanted(PROJECT["optional-dependencies"]["plot"])
    assert in_spack(plotting) == {name: version for name, version in extra.items() if name != "imageio-ffmpeg"}
    # what a repository of Spack's has too old a version of comes with this one
    assert (SPACK.parents[1] / "py_meshio/package.py").exists()
