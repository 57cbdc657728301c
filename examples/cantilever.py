"""A rubber cantilever that its weight bends, stepped from Python; on two ranks: mpirun -n 2 python cantilever.py."""

from mpi4py import MPI

import parsolid

rubber = {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
scene = parsolid.Scene(
    dimension=2,
    end_time=0.25,
    method={"kind": "tlsph"},
    bodies=[{"shape": {"box": {"lower": [0, 0], "upper": [0.4, 0.1]}}, "particles": [41, 11], "material": rubber}],
    boundaries=[{"kind": "fixed", "plane": "X = 0", "mirror": False}],
    loads={"acceleration": [0, -9.81]},
    probes=[{"name": "tip", "at": [0.4, 0.05], "fields": ["displacement"]}],
    output={"directory": "results/cantilever", "fields_interval": 0.05, "pictures": False},
)
lowest = 0.0
with parsolid.Simulation(scene, output=scene.output.directory) as simulation:
    while not simulation.finished:
        simulation.step(20)
        lowest = min(lowest, simulation.probes()["tip.displacement_y"])
if MPI.COMM_WORLD.rank == 0:
    print(f"the tip sinks by {-1e3 * lowest:.1f} mm at most")
    results = parsolid.load(scene.output.directory)
    results.plot("tip.displacement_y").figure.savefig("cantilever.png")
