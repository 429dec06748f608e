"""A small material point code of its own habits, to be connected by an adapter: tents, plane strain, dense algebra.

Nodes are numbered along x first, points come as columns, shear strain is the tensor's, tension is positive.
"""

import numpy as np


class Mesh:
    def __init__(self, x0, y0, dx, dy, nx, ny):
        self.x0, self.y0, self.dx, self.dy, self.nx, self.ny = x0, y0, dx, dy, nx, ny

    def locate(self, px, py):
        """Nodes (p, 4), weights, and derivatives of the four tents around each point."""
        sx, sy = (px - self.x0) / self.dx, (py - self.y0) / self.dy
        i, j = np.floor(sx).astype(int), np.floor(sy).astype(int)
        r, s = sx - i, sy - j
        nodes = np.stack([j * (self.nx + 1) + i + a + b * (self.nx + 1) for b in (0, 1) for a in (0, 1)], axis=1)
        w = np.stack([(1 - r) * (1 - s), r * (1 - s), (1 - r) * s, r * s], axis=1)
        wx = np.stack([-(1 - s), 1 - s, -s, s], axis=1) / self.dx
        wy = np.stack([-(1 - r), -r, 1 - r, r], axis=1) / self.dy
        return nodes, w, wx, wy


class Solver:
    def __init__(self, mesh, nu):
        self.mesh, self.nu = mesh, nu
        self.bc = {}

    def fix(self, node, component, value=0.0):
        self.bc[2 * node + component] = value

    def solve(self, px, py, area, young, fx, fy):
        """Displacements (2, p) and stresses (3, p) of the points."""
        nodes, w, wx, wy = self.mesh.locate(px, py)
        n = 2 * (self.mesh.nx + 1) * (self.mesh.ny + 1)
        lam, mu = self.nu / (1 + self.nu) / (1 - 2 * self.nu), 1 / (2 * (1 + self.nu))
        law = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, 2 * mu]])
        K, f, strains = np.zeros((n, n)), np.zeros(n), []
        for p in range(len(px)):
            B = np.zeros((3, 8))
            B[0, 0::2], B[1, 1::2] = wx[p], wy[p]
            B[2, 0::2], B[2, 1::2] = wy[p] / 2, wx[p] / 2
            dof = np.stack([2 * nodes[p], 2 * nodes[p] + 1], axis=1).ravel()
            K[np.ix_(dof, dof)] += area[p] * young[p] * B.T @ np.diag([1, 1, 2]) @ law @ B
            f[dof] += np.outer(w[p], [fx[p], fy[p]]).ravel()
            strains.append((dof, B))
        u = np.zeros(n)
        held = np.array(sorted(self.bc), dtype=int)
        u[held] = [self.bc[k] for k in held]
        free = np.setdiff1d(np.flatnonzero(np.diag(K) > 0), held)
        u[free] = np.linalg.solve(K[np.ix_(free, free)], (f - K @ u)[free])
        at_points = np.einsum("pk,pkc->cp", w, u.reshape(-1, 2)[nodes])
        stress = np.stack([young[p] * law @ (B @ u[dof]) for p, (dof, B) in enumerate(strains)], axis=1)
        return at_points, stress
