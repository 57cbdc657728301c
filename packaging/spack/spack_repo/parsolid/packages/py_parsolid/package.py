"""Spack 1.0 or newer; how to use it stands in repo.yaml."""

from spack_repo.builtin.build_systems.python import PythonPackage

from spack.package import *


class PyParsolid(PythonPackage):
    """Solids simulated with particles on many processors."""

    homepage = "https://example.org/parsolid"
    # a checkout: spack develop -p /path/to/checkout py-parsolid@main
    git = "https://example.org/parsolid.git"

    license("BSD-3-Clause")

    version("main", branch="main")

    variant("plot", default=False, description="Pictures, pages that turn")

    depends_on("python@3.11:", type=("build", "run"))
    depends_on("py-setuptools@68:", type="build")
    # setuptools before 70.1 makes no wheel by itself
    depends_on("py-wheel", type="build")
    depends_on("mpi", type=("build", "run"))
    depends_on("py-mpi4py@4:", type=("build", "run"))
    depends_on("py-numpy@1.26:", type=("build", "run"))
    depends_on("py-numba@0.61:", type=("build", "run"))
    depends_on("py-h5py@3.10:", type=("build", "run"))
    depends_on("py-meshio@5.3:", type=("build", "run"))
    depends_on("py-pydantic@2.10:", type=("build", "run"))
    depends_on("py-tomli-w@1:", type=("build", "run"))
    depends_on("py-rich@13:", type=("build", "run"))
    depends_on("py-scipy@1.11:", type=("build", "run"))
    with when("+plot"):
        depends_on("py-pyvista@0.44:", type="run")
        depends_on("py-matplotlib@3.8:", type="run")
        # 0.5 is asked for elsewhere; Spack's newest is 0.4.9
        depends_on("py-imageio-ffmpeg", type="run")
