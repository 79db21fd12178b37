"""The paper's numbers, and solutions by independent programs to the digits that they agree in."""

INERTIA = (449.5, 264.6, 312.5)
FREQUENCY = (0.7, 0.8, 0.1)
DISTURBANCE = {"amplitude": (0.01, 0.02, 0.001), "frequency": FREQUENCY}
THREE_AXIS = {
    "inertia": INERTIA,
    "k3": 0.05,
    "k4": 0.01,
    "mu": 1.0,
    "a": 0.1,
    "w0": (-1.0, 1.0),
    "z0": 1.27,
    "omega0": (0.1, -0.11, 0.0),
    "orbit_rate": 0.0011,
}
RATE = {"inertia": INERTIA, "k1": 5.0, "k2": 10.0, "omega0": (0.1, -0.11, 0.1)}

# Third rate held, C_bo taken as 1: w1 w2 z ω1 ω2, from DOP853 at a tolerance of 1e-12.
THREE_AXIS_DIGITS = {
    1: "-0.851881952 0.854286967 1.27668478 0.108906382 -0.115762285",
    10: "-0.0771835613 0.0996920062 1.25752275 0.119500366 -0.108519713",
    50: "-0.27100682 -0.426002561 0.0201378003 0.0380914367 0.0669546727",
    100: "0.475167421 0.425509462 -0.0211442977 -0.0167520541 -0.016106661",
    200: "0.00403253398 0.0380743072 -1.2147126e-4 0.00315826567 0.0201422991",
    500: "6.53474535e-4 0.00282377877 -6.56529e-7 2.88946e-4 -3.18765e-5",
}
THREE_AXIS_STATES = {
    time: [float(digits) for digits in row.split()] for time, row in THREE_AXIS_DIGITS.items()
}

# d1 and d2 cancelled, d3 = 0: ω1 ω2 ω3.
RATES = {
    0.1: (-0.1585116283, 0.9360311234, 0.0971152926),
    0.5: (-0.1926189075, 0.9657223368, 0.0381903163),
    1.0: (-0.0936715593, 0.4683755027, 0.0087779016),
    5.0: (-2.523999840e-4, 1.261999920e-3, 6.370575e-8),
}
