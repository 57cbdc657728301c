"""An L-shaped bracket with a fillet and two holes, in mm, written as STEP by Gmsh's OpenCASCADE kernel."""

from pathlib import Path

import gmsh

gmsh.initialize()
occ, model = gmsh.model.occ, gmsh.model
base, wall = occ.addBox(0, 0, 0, 60, 30, 6), occ.addBox(0, 0, 0, 6, 30, 40)
(body,), _ = occ.fuse([(3, base)], [(3, wall)])
occ.synchronize()
inner = [edge for _, edge in model.getEntities(1) if abs(occ.getCenterOfMass(1, edge)[0] - 6) < 1e-6]
inner = [edge for edge in inner if abs(occ.getCenterOfMass(1, edge)[2] - 6) < 1e-6]
((_, body),) = occ.fillet([body[1]], inner, [5])
occ.cut([(3, body)], [(3, occ.addCylinder(45, y, -1, 0, 0, 8, 3.5)) for y in (8, 22)])
occ.synchronize()
gmsh.write(str(Path(__file__).parent / "bracket.step"))
gmsh.finalize()
