"""Brackets by automatic differentiation against SymPy, other coordinates and printed formulas."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsat.controllability.lie import (
    ControlField,
    DriftField,
    bracket_words,
    control_fields,
    lie_bracket,
    pack,
    tangent_matrix,
    to_tangent,
)
from tests.controllability.oracles import symmetric_product

from .fields import JA, fields, paper_cross, random_state, rotating_disturbance

seeds = st.integers(0, 10_000)


@jax.jit
def jacobi_terms(state):
    f, g1, g2 = fields(disturbance=jnp.array([0.1, 0.2, -0.3]), orbit_rate=0.3)
    a, b, c = lie_bracket(f, g2), lie_bracket(f, g1), lie_bracket(lie_bracket(f, g2), g1)
    b = lie_bracket(f, b)
    swapped = lie_bracket(a, b)(state), lie_bracket(b, a)(state)
    cyclic = [
        lie_bracket(x, lie_bracket(y, z))(state) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))
    ]
    return swapped, jnp.stack(cyclic)


@pytest.mark.slow
@given(seeds)
@settings(max_examples=25, deadline=None)
def test_antisymmetry_and_jacobi_identity(seed):
    (forward, backward), cyclic = jacobi_terms(random_state(seed))
    np.testing.assert_allclose(forward, -backward, rtol=1e-12, atol=1e-12)
    size = float(jnp.max(jnp.abs(cyclic)))
    assert size > 1e-6
    np.testing.assert_allclose(jnp.sum(cyclic, axis=0), 0.0, atol=1e-9 * size)


def mrp_field(disturbance):
    """The same system in modified Rodrigues parameters about an attitude R0 (another chart)."""

    def field(x):
        s, omega = x[:3], x[3:]
        skew = jnp.array([[0, -s[2], s[1]], [s[2], 0, -s[0]], [-s[1], s[0], 0]])
        rate = 0.25 * ((1 - s @ s) * jnp.eye(3) + 2 * skew + 2 * jnp.outer(s, s)) @ omega
        omega_dot = jnp.linalg.solve(JA, disturbance - jnp.cross(omega, JA @ omega))
        return jnp.concatenate([rate, omega_dot])

    return field


def mrp_bracket(f, g):
    return lambda x: jax.jacfwd(g)(x) @ f(x) - jax.jacfwd(f)(x) @ g(x)


@jax.jit
def two_charts(state):
    torque = jnp.array([0.1, 0.2, -0.3])
    f, g1, g2 = fields(disturbance=torque)
    p = mrp_field(torque)
    p1, p2 = (
        lambda x, field=field: jnp.concatenate([jnp.zeros(3), field.acceleration])
        for field in (g1, g2)
    )
    ours = lie_bracket(lie_bracket(f, g1), lie_bracket(f, lie_bracket(f, g2)))
    theirs = mrp_bracket(mrp_bracket(p, p1), mrp_bracket(p, mrp_bracket(p, p2)))
    chart = jnp.concatenate([jnp.zeros(3), state[9:]])  # parameters measured from R
    value = theirs(chart)
    # At zero the parameters turn with a/4.
    return to_tangent(state, ours(state)), jnp.concatenate([4.0 * value[:3], value[3:]])


@pytest.mark.slow
@given(seeds)
@settings(max_examples=25, deadline=None)
def test_invariance_under_a_change_of_coordinates(seed):
    """A word of five letters in the matrix embedding and in modified Rodrigues parameters."""
    ours, theirs = two_charts(random_state(seed))
    np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_brackets_equal_sympy(seed):
    """General symmetric J, matrix embedding, brackets differentiated by SymPy."""
    r = sp.Matrix(3, 3, sp.symbols("r0:9"))
    w = sp.Matrix(sp.symbols("w0:3"))
    state = sp.Matrix([*r, *w])
    inertia = sp.Matrix(JA.tolist())
    orbital = r * sp.Matrix([0, -0.3, 0])
    cross = lambda a: sp.Matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])  # noqa: E731
    attitude = -cross(w - orbital) * r
    torque = sp.Matrix([0.1, 0.2, -0.3])
    drift = sp.Matrix([*attitude, *(inertia.inv() * (torque - cross(w) * inertia * w))])
    f, g1, g2 = fields(disturbance=jnp.array([0.1, 0.2, -0.3]), orbit_rate=0.3)
    symbolic = {
        "f": drift,
        "1": sp.Matrix([0] * 9 + [float(v) for v in g1.acceleration]),
        "2": sp.Matrix([0] * 9 + [float(v) for v in g2.acceleration]),
    }
    ours = {"f": f, "1": g1, "2": g2}

    def both(a, b):
        x, y = symbolic[a], symbolic[b]
        name = f"[{a}{b}]"
        symbolic[name] = y.jacobian(state) * x - x.jacobian(state) * y
        ours[name] = lie_bracket(ours[a], ours[b])
        return name

    names = [both("f", "1"), both("f", "2")]
    names += [both(names[0], "2"), both("f", names[1]), both(names[0], names[1])]
    point = random_state(seed)
    values = dict(zip(state, np.asarray(point).tolist(), strict=True))
    for name in names:
        exact = np.array(symbolic[name].subs(values), dtype=float)[:, 0]
        np.testing.assert_allclose(ours[name](point), exact, rtol=1e-11, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("at_rest", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_printed_formulas_with_the_inverse_inertia_restored(seed, at_rest):
    """(20)-(23) and (27)-(33), J⁻¹g in place of g, on random attitudes and rates."""
    torque = jnp.array([0.1, 0.2, -0.3])
    f, g1, g2 = fields(disturbance=torque, orbit_rate=0.3)
    state = random_state(seed)
    if at_rest:
        state = pack(jnp.eye(3), jnp.zeros(3))
    omega, inverse = state[9:], jnp.linalg.inv(JA)
    attitude = state[:9].reshape(3, 3)

    def printed(g):  # (20), (23), (27), (30), (33): [f, g] for a constant control vector g
        top = -paper_cross(g) @ attitude
        bottom = inverse @ (paper_cross(JA @ omega) - paper_cross(omega) @ JA) @ g
        return jnp.concatenate([top.reshape(9), bottom])

    v1, v2 = g1.acceleration, g2.acceleration
    np.testing.assert_allclose(lie_bracket(f, g1)(state), printed(v1), atol=1e-12)
    lam = 0.7 * v1 - 1.3 * v2
    mixed = ControlField(lam)
    g3 = lie_bracket(lie_bracket(f, mixed), mixed)
    raw3 = inverse @ paper_cross(lam) @ JA @ lam
    np.testing.assert_allclose(g3(state)[9:], 2.0 * raw3, atol=1e-12)  # (21), (22)
    np.testing.assert_allclose(g3(state)[:9], 0.0, atol=1e-12)
    np.testing.assert_allclose(lie_bracket(f, ControlField(raw3))(state), printed(raw3), atol=1e-12)
    h2 = lie_bracket(lie_bracket(f, g1), g1)
    raw2 = -inverse @ (paper_cross(JA @ v1) - paper_cross(v1) @ JA) @ v1  # (28), (29)
    np.testing.assert_allclose(h2(state)[9:], raw2, atol=1e-12)
    np.testing.assert_allclose(raw2, symmetric_product(jnp.asarray(JA), v1, v1), atol=1e-12)
    np.testing.assert_allclose(lie_bracket(f, h2)(state), printed(raw2), atol=1e-12)  # (30)
    eta = ControlField(0.4 * v1 + 1.1 * raw2)
    h3 = lie_bracket(lie_bracket(f, eta), eta)
    w = eta.acceleration
    raw = -inverse @ (paper_cross(JA @ w) - paper_cross(w) @ JA) @ w
    np.testing.assert_allclose(h3(state)[9:], raw, atol=1e-12)  # (31), (32)
    np.testing.assert_allclose(lie_bracket(f, h3)(state), printed(raw), atol=1e-12)  # (33)


def test_special_case_after_25():
    """g3 is printed as −(0, 0, 2λ1λ2(J2−J1)/J3), but (22) has taken the 2 out already."""
    moments = jnp.array([449.5, 264.6, 312.5])
    lam = jnp.array([0.7, -1.3, 0.0])
    g3 = jnp.linalg.inv(jnp.diag(moments)) @ paper_cross(lam) @ (moments * lam)
    right = lam[0] * lam[1] * (moments[0] - moments[1]) / moments[2]
    np.testing.assert_allclose(g3, [0.0, 0.0, right], atol=1e-15)
    v = lam / moments
    g3 = jnp.linalg.inv(jnp.diag(moments)) @ paper_cross(v) @ (moments * v)
    right = lam[0] * lam[1] * (moments[0] - moments[1]) / jnp.prod(moments)
    np.testing.assert_allclose(g3, [0.0, 0.0, right], rtol=1e-12)


def test_theorem_3_has_u_cross_alpha():
    """For attitude fields u^× A and α^× A the bracket turns with u × α."""

    class Turn(ControlField):
        def __call__(self, state):
            rate = paper_cross(self.acceleration) @ state[:9].reshape(3, 3)
            return jnp.concatenate([rate.reshape(9), jnp.zeros(3)])

    u, alpha = jnp.array([0.2, -1.0, 0.5]), jnp.array([1.1, 0.3, -0.4])
    state = random_state(1)
    value = lie_bracket(Turn(u), Turn(alpha))(state)[:9].reshape(3, 3)
    expected = paper_cross(jnp.cross(u, alpha)) @ state[:9].reshape(3, 3)
    np.testing.assert_allclose(value, expected, atol=1e-14)
    # The definition by flows: exponentials by series, difference quotients in both times.
    from scipy.linalg import expm

    def flow(vector, t, a):
        return expm(t * np.asarray(paper_cross(vector))) @ a

    a = np.asarray(state[:9]).reshape(3, 3)
    h = 1e-4
    quotient = sum(
        s1 * s2 * flow(u, -s1 * h, flow(alpha, s2 * h, flow(u, s1 * h, a)))
        for s1 in (1, -1)
        for s2 in (1, -1)
    ) / (4 * h * h)
    np.testing.assert_allclose(quotient, expected, atol=1e-6)


@pytest.mark.slow
def test_exact_orbit_term_cancels_and_the_approximation_does_not():
    state = random_state(4)
    words = {}
    for rate, orbit in ((0.0, "exact"), (0.3, "exact"), (0.3, "small angle")):
        f, g1, g2 = fields(orbit_rate=rate, orbit=orbit)
        brackets = bracket_words(f, (g1, g2), 4)
        words[rate, orbit] = tangent_matrix(list(brackets.values()), state)
    still, exact, approximate = words.values()
    np.testing.assert_allclose(exact, still, atol=1e-12)
    assert float(jnp.max(jnp.abs(approximate - still))) > 0.01


@pytest.mark.slow
def test_time_as_a_state():
    """With the time fixed T_d is constant; as a state its derivative enters the deeper brackets."""
    f, g1, _ = fields(disturbance=rotating_disturbance)
    frozen = DriftField(jnp.asarray(JA), disturbance=rotating_disturbance(jnp.asarray(2.0)))
    state = random_state(2, time=2.0)
    ff, plain, moving = lie_bracket, frozen, f
    assert float(moving(state)[12]) == 1.0
    shallow = ff(moving, ff(moving, g1))(state)[:12], ff(plain, ff(plain, g1))(state[:12])
    np.testing.assert_allclose(*shallow, atol=1e-12)
    deep = [ff(x, ff(x, ff(x, g1))) for x in (moving, plain)]
    change = deep[0](state)[9:12] - deep[1](state[:12])[9:]
    # [f, [f, [f, g]]] gains −⟨∂T_d/∂t⟩ through the second derivative of f: J⁻¹ twice.
    rate = jnp.linalg.solve(JA, jax.jacfwd(rotating_disturbance)(2.0))
    bend = symmetric_product(jnp.asarray(JA), g1.acceleration, rate)
    np.testing.assert_allclose(jnp.abs(change), jnp.abs(bend), rtol=1e-9, atol=1e-12)
    assert float(jnp.max(jnp.abs(bend))) > 1e-4
    with pytest.raises(ValueError, match="thirteenth"):
        moving(state[:12])


def test_brackets_jit_and_vmap_without_retracing():
    traces = []

    @jax.jit
    def evaluate(inertia, axis, states):
        traces.append(1)
        drift = DriftField(inertia, orbit_rate=0.1)
        (g,) = control_fields(inertia, axis)
        bracket = lie_bracket(lie_bracket(drift, g), lie_bracket(drift, lie_bracket(drift, g)))
        return jax.vmap(bracket)(states)

    states = jnp.stack([random_state(k) for k in range(5)])
    axis = jnp.array([[1.0], [2.0], [3.0]])
    first = evaluate(jnp.asarray(JA), axis, states)
    second = evaluate(2.0 * jnp.asarray(JA), axis, states)
    assert first.shape == (5, 12)
    assert len(traces) == 1
    np.testing.assert_allclose(second, first / 4.0, rtol=1e-9, atol=1e-12)
