"""Settlement of soil by a small material point method: tents, plane strain, small strain; compression is positive."""

import numpy as np


class Particle:
    """A piece of soil of shear modulus G and bulk modulus K; `pull` is the force on it."""

    def __init__(self, place, area, G, K, pull=(0.0, 0.0)):
        self.place, self.area, self.G, self.K, self.pull = place, area, G, K, pull
        self.moved, self.pressure = (0.0, 0.0), (0.0, 0.0, 0.0, 0.0)


class Ground:
    """Cells of size dx by dy; `corner` is the lower left one. Knots are counted along a row, rows from below."""

    def __init__(self, corner, dx, dy, columns, rows):
        self.corner, self.dx, self.dy, self.columns, self.rows = corner, dx, dy, columns, rows
        self.pins = []

    def pin(self, column, row, sideways=None, upwards=None):
        """Hold a knot at displacements; None leaves it free to go."""
        self.pins.append((row * (self.columns + 1) + column, sideways, upwards))

    def around(self, particle):
        """Knots of the particle's cell, and of each the weight and its two slopes."""
        r, s = (particle.place[0] - self.corner[0]) / self.dx, (particle.place[1] - self.corner[1]) / self.dy
        column, row = int(np.floor(r)), int(np.floor(s))
        r, s, found = r - column, s - row, []
        for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
            along, up = (r if a else 1 - r), (s if b else 1 - s)
            slopes = (1 if a else -1) / self.dx * up, (1 if b else -1) / self.dy * along
            found.append(((row + b) * (self.columns + 1) + column + a, along * up, *slopes))
        return found

    def settle(self, particles):
        """Equilibrium: sets `moved` (right, up) and `pressure` (xx, yy, zz, xy) of the particles."""
        size = 2 * (self.columns + 1) * (self.rows + 1)
        K, f, u = np.zeros((size, size)), np.zeros(size), np.zeros(size)
        for p in particles:
            lame = p.K - 2 * p.G / 3
            for i, weight, ix, iy in self.around(p):
                f[2 * i : 2 * i + 2] += np.multiply(weight, p.pull)
                for j, _, jx, jy in self.around(p):
                    mixed = lame * np.outer((ix, iy), (jx, jy)) + p.G * np.outer((jx, jy), (ix, iy))
                    block = mixed + p.G * (ix * jx + iy * jy) * np.eye(2)
                    K[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] += p.area * block
        held = np.zeros(size, bool)
        for knot, *displacements in self.pins:
            for axis, value in enumerate(displacements):
                if value is not None:
                    held[2 * knot + axis], u[2 * knot + axis] = True, value
        free = ~held & (K.diagonal() > 0)
        u[free] = np.linalg.solve(K[free][:, free], (f - K @ u)[free])
        for p in particles:
            knots = self.around(p)
            p.moved = tuple(sum(weight * u[2 * i + axis] for i, weight, *_ in knots) for axis in (0, 1))
            e = np.array([[sum(k[2 + b] * u[2 * k[0] + a] for k in knots) for b in (0, 1)] for a in (0, 1)])
            spread = (p.K - 2 * p.G / 3) * np.trace(e)
            p.pressure = (*(-spread - 2 * p.G * np.array([e[0, 0], e[1, 1], 0.0])), -p.G * (e[0, 1] + e[1, 0]))
