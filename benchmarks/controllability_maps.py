"""Margin maps: one vmapped program against loops of NumPy finite differences and of SymPy.

Run with `python benchmarks/controllability_maps.py`. Times are per layout, within one run on one
machine, after a warm-up, and the margins are checked equal before any ratio is printed.
"""

import time

import jax
import numpy as np
import sympy as sp

jax.config.update("jax_enable_x64", True)

from jaxsat.controllability.maps import margins_over_inertias, physical_inertias  # noqa: E402

AXES = np.array([[1.0, 0.2], [0.1, 1.0], [0.3, -0.2]])


def margin_of(inertia, product):
    """The margin from a function that makes ⟨x:y⟩, written out plainly."""
    inverse = np.linalg.inv(inertia)

    def relative(p, q):
        x, y = inverse @ p, inverse @ q
        norm = np.linalg.norm
        return inertia @ product(x, y) / (norm(x) * norm(q) + norm(y) * norm(p))

    g = [axis / np.linalg.norm(axis) for axis in AXES.T]
    columns = [*g, relative(g[0], g[0]), relative(g[0], g[1]), relative(g[1], g[1])]
    h = [columns[2], columns[4]]
    size = [np.linalg.norm(vector) for vector in h]
    unit = [v / s if s else v for v, s in zip(h, size, strict=True)]
    for i in range(2):
        if size[i]:
            columns.append(size[i] * relative(g[i], unit[i]))
            columns.append(size[i] * relative(unit[i], unit[i]))
    return np.linalg.svd(np.stack(columns, axis=1), compute_uv=False)[2]


def finite_differences(moments):
    """⟨x:y⟩ = [[f, x], y] by a second difference of the drift."""
    inertia = np.diag(moments)

    def drift(omega):
        return np.linalg.solve(inertia, -np.cross(omega, inertia @ omega))

    def product(x, y):
        a, b = x / np.linalg.norm(x), y / np.linalg.norm(y)
        mixed = drift(a + b) - drift(a - b) - drift(b - a) + drift(-a - b)
        return 0.25 * mixed * np.linalg.norm(x) * np.linalg.norm(y)

    return margin_of(inertia, product)


def symbolic(moments):
    """⟨x:y⟩ from the drift differentiated by SymPy, once for each layout."""
    inertia = sp.diag(*[float(m) for m in moments])
    omega = sp.Matrix(sp.symbols("w0:3"))
    drift = inertia.inv() * -omega.cross(inertia * omega)
    hessian = [np.array(sp.hessian(component, omega), dtype=float) for component in drift]

    def product(x, y):
        return np.array([x @ h @ y for h in hessian])

    return margin_of(np.diag(moments), product)


def per_item(function, items):
    start = time.perf_counter()
    values = [function(item) for item in items]
    return np.array(values), (time.perf_counter() - start) / len(items)


def main():
    _, moments = physical_inertias(450)
    jax.block_until_ready(margins_over_inertias(moments, AXES))
    start = time.perf_counter()
    margins = np.asarray(margins_over_inertias(moments, AXES))
    whole = time.perf_counter() - start
    each = whole / len(moments)
    print(f"vmapped map: {len(moments)} layouts in {whole:.2f} s")
    picks = np.random.default_rng(0).choice(len(moments), 500, replace=False)
    for name, function, chosen in (
        ("NumPy finite differences", finite_differences, picks),
        ("SymPy", symbolic, picks[:20]),
    ):
        values, loop = per_item(function, moments[chosen])
        worst = np.max(np.abs(values - margins[chosen]))
        if worst > 1e-9:
            raise SystemExit(f"{name}: margins differ by {worst:.1e}")
        print(f"{name}: {loop / each:.0f} times slower a layout, margins equal to {worst:.0e}")


if __name__ == "__main__":
    main()
