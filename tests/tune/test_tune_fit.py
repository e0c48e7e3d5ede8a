"""Maximum marginal likelihood, its priors, and what GPy does to the unwary."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from gp_support import QUICK, covariance_of, data, fitted, standardised, wave
from scipy.stats import multivariate_normal, norm
from tune_support import differences

from socasadi.tune.surrogate import FitSettings, evidence, fit
from socasadi.tune.surrogate._fit import Loss


def test_warping_straightens_a_function_that_is_steep_at_one_face():
    points = np.random.default_rng(0).random((30, 1))
    values = standardised(np.log(0.01 + points[:, 0]))
    x = np.linspace(0.005, 0.995, 100)[:, None]
    truth = (np.log(0.01 + x[:, 0]) - np.log(0.01 + points[:, 0]).mean()) / np.log(0.01 + points[:, 0]).std()

    def error(warp):
        return np.sqrt(
            np.mean((fitted(points, values, FitSettings(warp=warp, **QUICK)).predict(x)[0][:, 0] - truth) ** 2)
        )

    assert error(True) < 0.7 * error(False)


def log_posterior(points, values, known, hyper, settings):
    """Marginal likelihood from scipy's multivariate normal, and the priors."""
    noise = known + hyper.noise + 1e-8
    covariance = covariance_of(hyper, settings.kernel, points, points) + np.diag(noise)
    value = multivariate_normal.logpdf(values, np.full(len(values), hyper.mean), covariance)
    if not settings.priors:
        return value
    # Lengthscales are log-normal; where the priors are not bold, they are less likely the more they are apart.
    d, logs = len(hyper.lengthscales), np.log(hyper.lengthscales)
    precision = np.eye(d) / 3 + (not settings.bold) * (np.eye(d) - np.ones((d, d)) / d) / 0.5**2
    centre = np.full(d, np.sqrt(2) + 0.5 * np.log(d))
    value += multivariate_normal.logpdf(logs, centre, np.linalg.inv(precision)) - logs.sum()
    if settings.noise is None and not settings.bold:
        value += norm.logpdf(np.log(hyper.noise), np.log(1e-2), 3)
    if settings.additive:
        value += norm.logpdf(np.log(hyper.additive / hyper.variance), 0, 2)
    return value


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
@pytest.mark.parametrize("mean", ["constant", "zero"])
@pytest.mark.parametrize("additive", [False, True])
@pytest.mark.parametrize("noise", [None, 0.02])
@pytest.mark.parametrize(("priors", "bold"), [(False, False), (True, False), (True, True)])
def test_the_evidence_is_the_density_of_the_data_and_has_its_gradient(kernel, mean, additive, noise, priors, bold):
    points, values = data(15, 2)
    known = np.random.default_rng(5).uniform(0.0, 0.2, 15)
    settings = FitSettings(kernel, mean, additive, priors, noise, bold=bold)
    loss = Loss(points, values, known, settings)
    constants = []
    for z in np.random.default_rng(6).uniform(-1.0, 0.5, (3, len(loss.bounds))):
        value, gradient = loss(z)
        np.testing.assert_allclose(gradient, differences(lambda at: loss(at)[0], z, 1e-4), rtol=1e-5, atol=1e-5)
        hyper = loss.hyperparameters(z)
        constants.append(value + log_posterior(points, values, known, hyper, settings))
        np.testing.assert_allclose(loss.position(hyper), z, atol=1e-12)
    # Up to what does not depend on the hyperparameters.
    np.testing.assert_allclose(constants, constants[0], atol=1e-6)
    assert priors or abs(constants[0]) < 1e-6


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
def test_the_evidence_of_a_warping_has_its_gradient(kernel):
    points, values = data(15, 2)
    loss = Loss(points, values, np.zeros(15), FitSettings(kernel, warp=True))
    for z in np.random.default_rng(6).uniform(-1.0, 0.5, (3, len(loss.bounds))):
        _, gradient = loss(z)
        np.testing.assert_allclose(gradient, differences(lambda at: loss(at)[0], z, 1e-4), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("kernel", "additive", "priors", "bold"),
    [("rbf", False, False, False), ("matern52", False, True, True), ("matern52", True, True, False)],
)
def test_no_other_hyperparameters_are_more_likely(kernel, additive, priors, bold):
    points, values = data(30, 3)
    values = standardised(values + 0.2 * np.random.default_rng(3).standard_normal(30))
    settings, known = FitSettings(kernel, additive=additive, priors=priors, bold=bold), np.zeros(30)
    found = fit(points, values, settings, np.random.default_rng(0))
    rng, best = np.random.default_rng(4), log_posterior(points, values, known, found, settings)
    for size in (0.01, 0.1, 1.0):
        for _ in range(60):
            other = replace(
                found,
                mean=found.mean + size * rng.standard_normal(),
                variance=found.variance * np.exp(size * rng.standard_normal()),
                additive=found.additive * np.exp(size * rng.standard_normal()),
                noise=found.noise * np.exp(size * rng.standard_normal()),
                lengthscales=np.minimum(found.lengthscales * np.exp(size * rng.standard_normal(3)), 1e3),
            )
            assert log_posterior(points, values, known, other, settings) <= best + 1e-3


def test_an_irrelevant_dimension_gets_a_long_lengthscale():
    points, values = data(40, 4)
    for kernel in ("rbf", "matern52"):
        for priors in (True, False):
            settings = FitSettings(kernel, additive=False, priors=priors, **QUICK)
            scales = fit(points, values, settings, np.random.default_rng(0)).lengthscales
            assert scales[0] < scales[1] < scales[2:].min()
            assert scales[2:].min() > 3 * scales[0]


def test_priors_that_are_not_bold_leave_less_of_the_lengthscales_of_few_data_to_chance():
    """Of a cost that is alike in all of ten coordinates."""
    points = np.random.default_rng(2).random((25, 10))
    values = standardised(np.sqrt(((points - 0.4) ** 2).sum(axis=1)))
    spreads = []
    for bold in (True, False):
        found = fit(points, values, FitSettings(bold=bold, **QUICK), np.random.default_rng(0))
        spreads.append(np.log(found.lengthscales).std())
    assert spreads[1] < 0.3 * spreads[0]


def test_a_sum_of_ten_functions_is_learnt_from_few_data():
    """Each of one coordinate: what a kernel of all coordinates does not know."""
    points = np.random.default_rng(2).random((140, 10))
    values = standardised(np.cos(9 * points).sum(axis=1))
    shares = []
    for additive in (False, True):
        posterior = fitted(points[:60], values[:60], FitSettings(additive=additive, **QUICK))
        missed = posterior.predict(points[60:])[0][:, 0] - values[60:]
        shares.append(np.mean(missed**2) / values[60:].var())
    assert shares[1] < 0.2 < 0.6 < shares[0]
    assert posterior.hyperparameters.additive > posterior.hyperparameters.variance


def test_fitted_noise_is_the_noise_that_was_added():
    points = np.random.default_rng(0).random((120, 2))
    values = standardised(wave(points)) + 0.3 * np.random.default_rng(1).standard_normal(120)
    hyper = fit(points, values, FitSettings(**QUICK), np.random.default_rng(0))
    assert np.sqrt(hyper.noise) == pytest.approx(0.3, rel=0.2)


def test_fixed_noise_stays_fixed_and_zero_mean_stays_zero():
    hyper = fit(*data(), FitSettings("rbf", "zero", priors=False, noise=1e-4), np.random.default_rng(0))
    assert hyper.noise == pytest.approx(1e-4, rel=1e-12)
    assert hyper.mean == 0.0


def test_smooth_data_do_not_drive_the_noise_to_nothing():
    hyper = fit(*data(50, 2), FitSettings(priors=False, **QUICK), np.random.default_rng(0))
    assert 1e-6 * (1 - 1e-9) <= hyper.noise < 1e-3


def test_constant_targets_leave_a_usable_process():
    mean, std = fitted(data()[0], np.zeros(40)).predict(np.random.default_rng(1).random((5, 4)))
    np.testing.assert_allclose(mean, 0.0, atol=1e-6)
    assert np.all(std > 1e-6)


def test_contradicting_values_at_one_point_are_averaged():
    points, values = data(30, 2)
    points, values = np.vstack([points, points[0], points[0]]), np.append(values, values[0] + [0.5, -0.5])
    posterior = fitted(points, values, FitSettings(noise=1e-4, **QUICK))
    assert posterior.hyperparameters.variance > 0.02
    assert posterior.predict(points[:1])[0][0, 0] == pytest.approx(values[0], abs=0.05)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_never_reaches_gpy(bad):
    points, values = data()
    with pytest.raises(ValueError, match="not finite"):
        fit(points, np.where(np.arange(40) == 7, bad, values), FitSettings(), np.random.default_rng(0))
    points[3, 2] = bad
    with pytest.raises(ValueError, match="not finite"):
        fit(points, values, FitSettings(), np.random.default_rng(0))


def test_the_fit_keeps_no_hold_of_the_callers_arrays():
    points, values = data()
    kept = points.copy(), values.copy()
    posterior = fitted(points, values)
    np.testing.assert_array_equal(points, kept[0])
    np.testing.assert_array_equal(values, kept[1])
    x = np.full((1, 4), 0.3)
    mean, std = posterior.predict(x)
    points[:] = 0.0
    values[:] = 0.0
    np.testing.assert_array_equal(posterior.predict(x)[0], mean)
    np.testing.assert_array_equal(posterior.predict(x)[1], std)


def test_the_fit_neither_reads_nor_moves_the_global_random_state():
    np.random.seed(1)  # noqa: NPY002
    first = fit(*data(), FitSettings(**QUICK), np.random.default_rng(0))
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    np.random.seed(2)  # noqa: NPY002
    second = fit(*data(), FitSettings(**QUICK), np.random.default_rng(0))
    np.testing.assert_array_equal(first.lengthscales, second.lengthscales)
    np.random.seed(1)  # noqa: NPY002
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_gpy_comes_late_and_leaves_the_warning_filters_and_error_state_alone():
    code = """
import sys, warnings, logging
import numpy as np
from socasadi.tune.surrogate import FitSettings, fit
assert "GPy" not in sys.modules, "GPy was imported before it was needed"
before, errors, level = list(warnings.filters), np.geterr(), logging.getLogger().level
fit(np.random.default_rng(0).random((8, 2)), np.arange(8.0), FitSettings(), np.random.default_rng(0))
assert "GPy" in sys.modules
assert list(warnings.filters) == before, "the warning filters changed"
assert np.geterr() == errors and logging.getLogger().level == level
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"kernel": "cubic"}, "unknown kernel 'cubic'; known are 'matern52', 'rbf'"),
        ({"mean": "linear"}, "unknown mean 'linear'; known are 'constant', 'zero'"),
        ({"noise": 0.0}, "noise is 0.0"),
        ({"noise": "small"}, "noise is 'small'"),
        ({"noise": np.nan}, "noise is nan"),
    ],
)
def test_a_setting_that_is_not_known_is_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        FitSettings(**settings)


def test_the_evidence_tells_the_kernel_that_made_the_data():
    # Two draws of a process with short lengthscales in one coordinate: rough data are no Gaussian-kernel data.
    points = np.random.default_rng(0).random((40, 1))
    r = np.abs(points - points.T) / 0.1
    covariance = (1 + np.sqrt(5) * r + 5 / 3 * r**2) * np.exp(-np.sqrt(5) * r) + 1e-8 * np.eye(40)
    values = np.linalg.cholesky(covariance) @ np.random.default_rng(1).standard_normal(40)
    rough, smooth = (evidence(points, values, FitSettings(kernel, noise=1e-6)) for kernel in ("matern52", "rbf"))
    assert rough > smooth + 3
    # It is the density of the data at what a fit finds, or little less.
    settings = FitSettings(noise=1e-6, **QUICK)
    loss = Loss(points, values, np.zeros(40), settings)
    best = -loss(loss.position(fit(points, values, settings, np.random.default_rng(0))))[0]
    assert best - 3 < evidence(points, values, settings) <= best + 1e-2


def test_a_warm_start_from_the_optimum_stays_as_likely():
    points, values = data(30, 3)
    values = standardised(values + 0.2 * np.random.default_rng(3).standard_normal(30))
    settings = FitSettings(**QUICK)
    full = fit(points, values, settings, np.random.default_rng(0))
    warm = fit(points, values, settings, np.random.default_rng(0), start=full)
    loss = Loss(points, values, np.zeros(30), settings)
    assert loss(loss.position(warm))[0] <= loss(loss.position(full))[0] + 1e-3


HOSTILE = {
    "smooth": lambda points, rng: wave(points),
    "constant": lambda points, rng: np.zeros(len(points)),
    "noise alone": lambda points, rng: rng.standard_normal(len(points)),
    "one outlier": lambda points, rng: np.where(np.arange(len(points)) == 3, 1e6, wave(points)),
    "two levels": lambda points, rng: np.sign(points[:, 0] - 0.5),
    "one coordinate": lambda points, rng: np.sin(40 * points[:, 0]),
}


@pytest.mark.parametrize("priors", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize("kind", HOSTILE)
def test_no_data_drive_the_hyperparameters_out_of_sensible_bounds(kind, priors):
    points = np.random.default_rng(0).random((25, 2))
    values = HOSTILE[kind](points, np.random.default_rng(1))
    values = (values - values.mean()) / (values.std() or 1.0)
    posterior = fitted(points, values, FitSettings(priors=priors, **QUICK))
    hyper = posterior.hyperparameters
    assert 1e-3 <= hyper.variance <= 1e3
    assert 1e-7 <= hyper.noise <= 1.0 + 1e-9
    assert np.all((hyper.lengthscales >= 1e-3) & (hyper.lengthscales <= 1e4))
    assert abs(hyper.mean) <= 10
    assert all(isinstance(value, float) for value in (hyper.variance, hyper.noise, hyper.mean))
    mean, std = posterior.predict(np.random.default_rng(2).random((50, 2)))
    assert np.isfinite(mean).all()
    assert (std > 0).all()
