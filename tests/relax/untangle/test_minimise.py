"""Minimisation: closed forms and SciPy as references, and that it never goes up."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen, rosen_der

from dvr_cli.relax.untangle.minimise import minimise


def test_a_quadratic_form_is_minimised_where_its_linear_system_is_solved():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(30, 30))
    matrix, right = root @ root.T + np.eye(30), rng.normal(size=30)

    def form(x):
        return float(x @ matrix @ x / 2 - right @ x), matrix @ x - right

    x = minimise(form, np.zeros(30), 2000, 1e-15)
    np.testing.assert_allclose(x, np.linalg.solve(matrix, right), atol=1e-5)


@pytest.mark.parametrize("n", [2, 20])
def test_rosenbrock_takes_no_more_than_twice_the_evaluations_of_scipy(n):
    count = 0

    def function(x):
        nonlocal count
        count += 1
        return float(rosen(x)), rosen_der(x)

    start = np.full(n, -1.0)
    x = minimise(function, start, 2000, 1e-12)
    reference = minimize(
        rosen, start, jac=rosen_der, method="L-BFGS-B", options={"ftol": 1e-14, "gtol": 1e-8}
    )
    assert rosen(x) < 1e-10
    assert count <= 2 * reference.nfev


def test_it_ends_after_the_evaluations_allowed_or_when_told_to_and_never_higher():
    values = []

    def function(x):
        values.append(float(rosen(x)))
        return values[-1], rosen_der(x)

    start = np.array([-1.2, 1.0, 3.0])
    for evaluations in (1, 2, 10, 40):
        values.clear()
        x = minimise(function, start, evaluations, 0.0)
        assert evaluations <= len(values) < evaluations + 30
        assert rosen(x) == min(values[0], rosen(x))
    values.clear()
    minimise(function, start, 1000, 0.0, stop=lambda: True)
    assert len(values) < 10


def test_values_that_are_not_finite_are_avoided():
    def barrier(x):
        with np.errstate(invalid="ignore", divide="ignore"):
            return float((x - np.log(x)).sum()), 1 - 1 / x

    np.testing.assert_allclose(minimise(barrier, np.array([0.01, 30.0]), 200, 1e-15), 1.0, atol=1e-5)
