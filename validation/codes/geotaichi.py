"""GeoTaichi 0.2.6 (GPL-3.0, github.com/Yihao-Shi/GeoTaichi), a run of its own for each case:
PYTHON -I geotaichi.py CASE ANSWER Linear|GIMP.

PYTHON is a 3.10 with `pip install geotaichi`, of an environment of its own: the package pins NumPy 1.23.5, SciPy 1.10.1
and Taichi 1.6.0. Nothing of this repository is imported. The package's two-dimensional kernels do not compile (a force
of three components is put on nodes of two), so that a plane problem is a layer of one cell, its points in the middle
and all its nodes held across it: exactly plane strain. Its grids start at (0, 0); points go in by its restart file, as
a text file passes a kernel that does not compile either.

Loads are small, `SMALL` of the stiffness of a cell, and answers are large again. Motion is damped by kinetic damping:
under the full load all velocities are set to zero whenever the kinetic energy has passed a peak.
"""

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

SMALL = 1e-7
"""Of E h^2, for the sum of the forces' sizes along an axis. Displacements are then of some 1e-5 cells: finite strain is
of that order, and positions, ten cells from the origin, are rounded to 1e-15 in each of some thousand steps."""
COURANT = 0.2
"""Part of the time in which a pressure wave crosses a cell: cells with few points are stiffer than full ones."""
LOOK = 5
"""Steps between two looks at the kinetic energy: a hundredth of the slowest periods asked for."""
ABLE = {
    "name": "GeoTaichi",
    "version": "0.2.6",
    "capabilities": [
        *("analysis", "quadrature at points", "moduli by point", "body forces", "any outline", "points anywhere"),
    ],
    "accuracy": 1e-4,
    "explicit": {"ramp": 8, "block": 200, "blocks": 80},
}


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns by name."""
    with path.open(encoding="utf-8") as file:
        names, *rows = list(csv.reader(file))
    return dict(zip(names, np.array(rows, float).reshape(-1, len(names)).T, strict=True))


class Layer:
    """A case as a layer of one cell: what GeoTaichi is given, and how its state is read."""

    def __init__(self, where: Path) -> None:
        said = json.loads((where / "case.json").read_text("utf-8"))
        self.where, self.points, self.held = where, table(where / "points.csv"), table(where / "held.csv")
        grid = {name: np.array(value, float) for name, value in said["grid"].items()}
        self.h, self.cells, self.poisson = grid["h"], grid["cells"].astype(int), said["material"]["poisson"]
        self.depth = float(self.h.min())
        self.x = np.stack([self.points["x"], self.points["y"]], axis=1) - grid["origin"]
        self.half = np.stack([self.points["half_x"], self.points["half_y"]], axis=1)
        self.force = np.stack([self.points["force_x"], self.points["force_y"]], axis=1) * self.depth
        self.young = self.points["young"]
        self.density = float(self.young.mean())  # so that waves take about as long in any units
        stiff = self.young.mean() * self.h.min() * self.depth
        self.scale = float(SMALL * stiff / np.abs(self.force).sum(axis=0).max())

    @property
    def time_step(self) -> float:
        """By the pressure wave in the stiffest points."""
        nu = self.poisson
        speed = np.sqrt(self.young.max() / self.density * (1 - nu) / (1 + nu) / (1 - 2 * nu))
        return float(COURANT * self.h.min() / speed)

    def supports(self, vector: Any) -> Iterator[dict]:
        """A condition for each node of both faces: across the layer all are held."""
        fixed = np.zeros((*(self.cells + 1), 2), bool)
        node = self.held["i"].astype(int), self.held["j"].astype(int)
        fixed[node] = np.stack([self.held["fixed_x"], self.held["fixed_y"]], axis=1) == 1
        for i, j in np.ndindex(*fixed.shape[:2]):
            x, y = (0.0 if held else None for held in fixed[i, j])
            for z in (0.0, self.depth):
                at = vector([i * self.h[0], j * self.h[1], z])
                held = {"VelocityX": x, "VelocityY": y, "VelocityZ": 0.0}
                yield {"BoundaryType": "VelocityConstraint", "StartPoint": at, "EndPoint": at, **held}

    def restart(self) -> Path:
        """The file of the points, at rest; each of the moduli is a material, numbered from 1."""
        p, middle = len(self.x), np.full((len(self.x), 1), self.depth / 2)
        volume = self.points["volume"] * self.depth
        kind = np.unique(self.young, return_inverse=True)[1]
        path = self.where / "restart.npz"
        state: dict[str, Any] = {"t_current": 0.0, "body_num": p}
        state |= {"bodyID": np.zeros(p, np.int32), "materialID": (kind + 1).astype(np.int32)}
        state |= {"active": np.ones(p, np.int32), "fix_v": np.zeros((p, 3), np.int32)}
        state |= {"mass": self.density * volume, "volume": volume}
        state |= {"position": np.hstack([self.x, middle]), "psize": np.hstack([self.half, middle])}
        state |= {name: np.zeros((p, 3)) for name in ("velocity", "traction")}
        state |= {name: np.zeros((p, 6)) for name in ("strain", "stress")}
        state |= {"velocity_gradient": np.zeros((p, 3, 3))}
        state |= {"state_vars": np.array({"estress": np.zeros(p)}, dtype=object)}
        np.savez(path, **state)
        return path

    def answer(self, path: Path, particle: Any) -> tuple[float, float]:
        """Write displacements and stresses; kinetic and strain energy of a layer of unit thickness."""
        p, nu = len(self.x), self.poisson
        x, v, stress, mass = (getattr(particle, name).to_numpy()[:p] for name in ("x", "v", "stress", "m"))
        u, s = (x[:, :2] - self.x) / self.scale, stress[:, [0, 1, 3]] / self.scale
        columns = [np.arange(p), self.points["x"], self.points["y"], *u.T, *s.T]
        np.savetxt(path, np.stack(columns, axis=1), "%.17g", ",", header="point,x,y,ux,uy,sxx,syy,sxy", comments="")
        xx, yy, xy = s.T
        work = (1 - nu**2) * (xx**2 + yy**2) - 2 * nu * (1 + nu) * xx * yy + 2 * (1 + nu) * xy**2
        kinetic = mass @ np.sum((v / self.scale) ** 2, axis=1) / 2 / self.depth
        return float(kinetic), float(self.points["volume"] @ (work / self.young)) / 2


def set_up(ti: Any, layer: Layer, function: str) -> Any:
    """GeoTaichi's MPM at rest."""
    ti.init(arch=ti.cpu, default_fp=ti.f64, cpu_max_num_threads=1, log_level=ti.ERROR)
    # the wheel's package `geotaichi` imports from above itself and cannot be imported; types are chosen by then
    from src import MPM

    size = np.append(layer.cells * layer.h, layer.depth) * (1 + 1e-9)  # so that a last cell is not rounded away
    moduli = np.unique(layer.young)
    mpm = MPM(log=False)
    mpm.set_configuration(
        log=False, domain=ti.Vector(size.tolist()), gravity=ti.Vector([0.0] * 3), mapping="USL", shape_function=function
    )
    mpm.set_solver({"Timestep": layer.time_step, "SimulationTime": 1.0, "SavePath": str(layer.where)}, log=False)
    held = {"max_velocity_constraint": 2 * int(np.prod(layer.cells + 1))}
    counts = {"max_material_number": len(moduli), "max_particle_number": len(layer.x), "max_constraint_number": held}
    mpm.memory_allocate(counts, log=False)
    elastic = {"Density": layer.density, "PossionRatio": layer.poisson}
    mpm.add_material(
        "LinearElastic",
        [{"MaterialID": k, "YoungModulus": young, **elastic} for k, young in enumerate(moduli.tolist(), 1)],
    )
    mpm.add_element({"ElementType": "R8N3D", "ElementSize": ti.Vector([*layer.h.tolist(), layer.depth])})
    mpm.add_body_from_file({"FileType": "NPZ", "Template": {"Restart": True, "File": str(layer.restart())}})
    if function == "GIMP":  # one domain for all points of a body, which a restart leaves out
        mpm.scene.element.calLength[0] = [*layer.half[0].tolist(), layer.depth / 2]
    mpm.add_boundary_condition(list(layer.supports(ti.Vector)))
    mpm.add_essentials({})
    mpm.check_critical_timestep()
    mpm.solver.engine.pre_calculation(mpm.sims, mpm.scene, mpm.neighbor)
    return mpm


def main(where: Path, answer: Path, function: str) -> None:
    """Reads `LEVEL STEPS`, steps, writes, says `moved KINETIC STORED`."""
    import taichi as ti

    layer = Layer(where)
    mpm, p = set_up(ti, layer, function), len(layer.x)
    particle, highest = mpm.scene.particle, 0.0
    for line in sys.stdin:
        level, steps = line.split()
        loads = np.zeros((particle.shape[0], 3))
        loads[:p, :2] = float(level) * layer.scale * layer.force
        particle.traction.from_numpy(loads)
        for k in range(int(steps)):
            mpm.solver.core(mpm.scene, mpm.neighbor)
            if k % LOOK == LOOK - 1 and float(level) == 1:
                kinetic = float(particle.m.to_numpy()[:p] @ np.sum(particle.v.to_numpy()[:p] ** 2, axis=1))
                if kinetic < highest:
                    particle.v.fill(0.0)
                    kinetic = 0.0
                highest = kinetic
        print("moved", *map(repr, layer.answer(answer, particle)), flush=True)


if __name__ == "__main__":
    case, answered, shape_function = sys.argv[1:]
    if case == "capabilities":
        named = {"name": f"GeoTaichi, {shape_function.replace('Linear', 'linear')}"}
        Path(answered).write_text(json.dumps({**ABLE, **named}), "utf-8")
    else:
        main(Path(case), Path(answered), shape_function)
