"""Exact oracles, written from the definitions and sharing no code with the package."""

import itertools
from fractions import Fraction

import jax.numpy as jnp
from sympy import QQ, Matrix
from sympy.polys.rings import ring

RANKS = {0: 0, 1: 2, 2: 5, 3: 6}


def rotation(w, x, y, z):
    """n and the integer matrix n R of the quaternion (w, x, y, z)."""
    n = w * w + x * x + y * y + z * z
    return n, [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]


def rotated(moments, axes, quaternion):
    """Integer inertia n² R J Rᵀ and integer axes n R g (lists of columns)."""
    _, r = rotation(*quaternion)
    inertia = [
        [sum(r[i][k] * moments[k] * r[j][k] for k in range(3)) for j in range(3)] for i in range(3)
    ]
    return inertia, [[sum(r[i][k] * g[k] for k in range(3)) for i in range(3)] for g in axes]


def _cross(a, b):
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _times(m, v):
    return [sum(m[i][k] * v[k] for k in range(3)) for i in range(3)]


def _reduce(rows, vector):
    """Residue of a vector after elimination by echelon rows [(pivot, row)]."""
    vector = list(vector)
    for pivot, row in rows:
        if vector[pivot]:
            factor = vector[pivot] / row[pivot]
            vector = [a - factor * b for a, b in zip(vector, row, strict=True)]
    return vector


def _extend(rows, basis, vector):
    residue = _reduce(rows, vector)
    pivot = next((i for i, entry in enumerate(residue) if entry), None)
    if pivot is None:
        return False
    rows.append((pivot, residue))
    basis.append(vector)
    return True


def _inverse(matrix):
    """Gauss-Jordan elimination of a positive definite matrix of fractions."""
    rows = [list(row) + [Fraction(i == k) for k in range(3)] for i, row in enumerate(matrix)]
    for i in range(3):
        rows[i] = [entry / rows[i][i] for entry in rows[i]]
        for k in range(3):
            if k != i:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i], strict=True)]
    return [row[3:] for row in rows]


def fraction_rank(inertia, axes):
    """dim S + dim of its closure under ×, with J⁻¹ and all vectors as fractions."""
    j = [[Fraction(entry) for entry in row] for row in inertia]
    inverse = _inverse(j)
    rows, basis = [], []
    for axis in axes:
        _extend(rows, basis, _times(inverse, [Fraction(a) for a in axis]))
    grown = True
    while grown:
        grown = False
        for x, y in itertools.combinations_with_replacement(list(basis), 2):
            total = [
                a + b for a, b in zip(_cross(x, _times(j, y)), _cross(y, _times(j, x)), strict=True)
            ]
            grown |= _extend(rows, basis, _times(inverse, total))
    spun_rows, spun = [], []
    for vector in basis:
        _extend(spun_rows, spun, vector)
    grown = True
    while grown:
        grown = False
        for x, y in itertools.combinations(list(spun), 2):
            grown |= _extend(spun_rows, spun, _cross(x, y))
    return len(basis) + len(spun)


class GibbsAlgebra:
    """Polynomial vector fields in (Gibbs vector ρ, ω, wheel momenta h), with exact brackets.

    Thrusters along `axes`, and wheels along `wheels` of a body in which `coasting` is fixed, the
    momentum of wheels without a motor.
    """

    def __init__(self, inertia, axes, wheels=(), coasting=(0, 0, 0)):
        names = [f"h{number}" for number in range(len(wheels))]
        self.ring, *symbols = ring(["r1", "r2", "r3", "w1", "w2", "w3", *names], QQ)
        self.symbols = symbols
        rho, omega, stored = symbols[:3], symbols[3:6], symbols[6:]
        inverse = Matrix(inertia).inv().tolist()

        def times(matrix, vector):
            return [
                sum(
                    (vector[k] * QQ(matrix[i][k].p, matrix[i][k].q) for k in range(3)), self.ring(0)
                )
                for i in range(3)
            ]

        j = Matrix(inertia).tolist()
        turn = _cross(rho, omega)
        along = sum((r * w for r, w in zip(rho, omega, strict=True)), self.ring(0))
        half = QQ(1, 2)
        attitude = [(omega[i] + turn[i] + rho[i] * along) * half for i in range(3)]
        momentum = [a + self.ring(int(b)) for a, b in zip(times(j, omega), coasting, strict=True)]
        for h, axis in zip(stored, wheels, strict=True):
            momentum = [total + h * int(a) for total, a in zip(momentum, axis, strict=True)]
        euler = times(inverse, [-t for t in _cross(omega, momentum)])
        self.drift = tuple(attitude + euler + [self.ring(0)] * len(wheels))
        zero = [self.ring(0)] * 3
        self.controls = []
        for number, axis in enumerate([*wheels, *axes]):
            rate = Matrix(inertia).inv() * Matrix(axis)
            taken = [self.ring(-int(number == k)) for k in range(len(wheels))]
            self.controls.append(tuple(zero + [self.ring(QQ(r.p, r.q)) for r in rate] + taken))

    def bracket(self, f, g):
        """Dg·f − Df·g, by exact differentiation of polynomials."""
        out = []
        for i in range(len(self.symbols)):
            total = self.ring(0)
            for k, symbol in enumerate(self.symbols):
                if f[k]:
                    total += g[i].diff(symbol) * f[k]
                if g[k]:
                    total -= f[i].diff(symbol) * g[k]
            out.append(total)
        return tuple(out)

    def at_rest(self, field):
        """Value at ρ = 0, ω = 0, as fractions."""
        values = [entry.coeff(1) for entry in field]
        return [Fraction(int(v.numerator), int(v.denominator)) for v in values]

    def divergence(self):
        """Of the drift: how fast a volume of states grows."""
        pairs = zip(self.drift, self.symbols, strict=True)
        return sum((entry.diff(symbol) for entry, symbol in pairs), self.ring(0))

    def rank_at(self, state, letters):
        """Rank of all right-nested brackets of so many letters, without the drift, at a state."""
        values = [QQ(x.numerator, x.denominator) for x in state]
        point = list(zip(self.symbols, values, strict=True))
        rows, basis, layer = [], [], list(self.controls)
        for _ in range(letters):
            for field in layer:
                _extend(rows, basis, [entry.evaluate(point) for entry in field])
            layer = [self.bracket(x, w) for x in (self.drift, *self.controls) for w in layer]
            layer = list({field for field in layer if any(field)})
        return len(basis)

    def closure_rank(self):
        """Rank at rest of all brackets of f and the fields found, until nothing new appears."""
        rows, basis, fields = [], [], []

        def take(field):
            if _extend(rows, basis, self.at_rest(field)):
                fields.append(field)
                return True
            return False

        for control in self.controls:
            take(control)
        grown = True
        while grown:
            grown = False
            for field in list(fields):
                grown |= take(self.bracket(self.drift, field))
            for a, b in itertools.combinations_with_replacement(list(fields), 2):
                grown |= take(self.bracket(a, b))
                grown |= take(self.bracket(self.bracket(self.drift, a), b))
        return len(basis)

    def depth_ranks(self, depth):
        """Rank at rest of all right-nested brackets up to each depth."""
        rows, basis, ranks = [], [], []
        layer = list(self.controls)
        for _ in range(depth):
            for field in layer:
                _extend(rows, basis, self.at_rest(field))
            ranks.append(len(basis))
            layer = [self.bracket(x, w) for x in (self.drift, *self.controls) for w in layer]
            layer = list({field for field in layer if any(field)})
        return ranks


def symmetric_product(inertia, x, y):
    """⟨x:y⟩ = J⁻¹(x^×Jy + y^×Jx), the rate part of [[f, x], y] (eqs. (21), (28), (31)).

    x^× is the cross matrix of the paper, the negative of the usual one. Any unit of inertia; x and
    y are accelerations in rad/s².
    """
    torque = jnp.cross(x, inertia @ y) + jnp.cross(y, inertia @ x)
    return -jnp.linalg.solve(inertia, torque)
