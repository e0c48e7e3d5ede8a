"""Records, the open-loop prediction error, and identification from simulated experiments."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from socasadi.model import Dense, Modal, Record, bounds_from_record, identify, prediction_error

T, NOISE = 0.05, 1e-3
THETA = np.array([4.6, 0.08, 6e-3, -3e-3, -3e-3, 5.2, 0.15, 0.5e-3, 5e-3, -5e-3])


def experiment(seed=0, samples=240, noise=NOISE, start=(0.0, 0.0, 0.0, 0.0), every=12):
    """Two oscillators integrated by scipy while random tensions are held, and measured with noise."""
    rng = np.random.default_rng(seed)
    levels = rng.uniform(-8, 8, (-(-samples // every), 3))
    tension = np.repeat(levels, every, axis=0)[:samples]
    (wy, zy, *gy), (wz, zz, *gz) = THETA.reshape(2, 5)

    def rates(u):
        rest_y, rest_z = np.dot(gy, u), np.dot(gz, u)

        def of(_, x):
            pull_y = wy**2 * (rest_y - x[0]) - 2 * zy * wy * x[1]
            pull_z = wz**2 * (rest_z - x[2]) - 2 * zz * wz * x[3]
            return [x[1], pull_y, x[3], pull_z]

        return of

    x, outputs = np.array(start), [[start[0], start[2]]]
    for u in tension[::every]:
        held = solve_ivp(rates(u), (0, every * T), x, t_eval=T * np.arange(1, every + 1), rtol=1e-9, atol=1e-12)
        x = held.y[:, -1]
        outputs += held.y[[0, 2]].T.tolist()
    clean = np.array(outputs)[: samples + 1]
    return Record(T, tension, clean + noise * rng.standard_normal(clean.shape))


RECORD = experiment()


def test_the_true_theta_is_wrong_by_the_noise_alone():
    assert prediction_error(Modal(), THETA, RECORD) == pytest.approx(NOISE * np.sqrt(2), rel=0.1)
    assert prediction_error(Modal(), THETA, experiment(noise=0.0)) < 1e-8
    assert prediction_error(Modal(), THETA * 1.2, RECORD) > 5e-3


def test_a_record_need_not_start_at_rest():
    moving = experiment(noise=0.0, start=(0.03, -0.2, -0.02, 0.1))
    assert prediction_error(Modal(), THETA, moving) < 1e-8


def test_feedthrough_acts_on_the_measurement_at_the_end_of_the_sample():
    model, rng = Dense(order=2, feedthrough=True), np.random.default_rng(1)
    theta = np.array([2.0, 0.1, -0.2, 3.0, *rng.uniform(-0.05, 0.05, 6), *rng.uniform(-3e-3, 3e-3, 6)])
    A, B, C, D = model.state_space(theta, T)
    tension, x, outputs = rng.uniform(-5, 5, (60, 3)), np.zeros(2), [np.zeros(2)]
    for u in tension:
        x = A @ x + B @ u
        outputs.append(C @ x + D @ u)
    assert prediction_error(model, theta, Record(T, tension, np.array(outputs))) < 1e-12


def test_the_prediction_is_not_corrected_by_measurements():
    """An offset in the outputs from one sample on stays an error to the end."""
    offset = np.zeros((241, 2))
    offset[120:, 0] = 0.01
    record = experiment(noise=0.0)
    shifted = Record(T, record.tension, record.output + offset)
    assert prediction_error(Modal(), THETA, shifted) == pytest.approx(0.01 * np.sqrt(121 / 240), rel=0.05)


@pytest.mark.parametrize("frequency", [1.0, 1e1, 1e3, 1e5])
@pytest.mark.parametrize("ratio", [-1e-2, -0.3, -1.0, -30.0, -1e4])
def test_an_unstable_theta_has_a_large_error_and_no_exception(frequency, ratio):
    theta = THETA.copy()
    theta[[0, 5]], theta[[1, 6]] = frequency, ratio
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert prediction_error(Modal(), theta, RECORD) > 10 * NOISE


@pytest.mark.parametrize("size", [1e10, 1e100, 1e200, 1e300])
def test_an_absurd_theta_has_an_error_or_infinity_and_no_exception(size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert prediction_error(Dense(), np.full(20, size), RECORD) > 10 * NOISE


@pytest.mark.parametrize("within_bounds", [True, False])
def test_identification_recovers_the_theta_of_the_record(within_bounds):
    found = identify(Modal(), RECORD, within_bounds=within_bounds)
    assert np.allclose(found[[0, 5]], THETA[[0, 5]], rtol=0.01)
    assert np.allclose(found[[1, 6]], THETA[[1, 6]], rtol=0.1)
    assert np.allclose(found[[2, 3, 4, 7, 8, 9]], THETA[[2, 3, 4, 7, 8, 9]], rtol=0, atol=1e-4)
    assert prediction_error(Modal(), found, RECORD) <= prediction_error(Modal(), THETA, RECORD)


def test_identification_stays_in_the_box_it_is_given():
    narrow = Modal().with_bounds([(2, 4), (0.02, 0.5), *[(-0.012, 0.012)] * 3] * 2)
    found = identify(narrow, RECORD)
    assert found[[0, 5]] == pytest.approx([4, 4], rel=1e-3)
    assert all(e.lower <= value <= e.upper for e, value in zip(narrow.entries, found, strict=True))


def test_a_dense_model_fits_as_well_as_the_truth():
    found = identify(Dense(), RECORD, starts=1)
    assert prediction_error(Dense(), found, RECORD) == pytest.approx(NOISE * np.sqrt(2), rel=0.1)
    fresh = experiment(seed=7)
    assert prediction_error(Dense(), found, fresh) < 2 * NOISE * np.sqrt(2)


def test_the_same_seed_identifies_the_same_theta():
    assert np.array_equal(identify(Modal(), RECORD, starts=1), identify(Modal(), RECORD, starts=1))


@pytest.mark.parametrize("margin", [1.5, 3.0])
def test_bounds_from_a_short_record_hold_the_truth(margin):
    short = experiment(seed=3, samples=120)
    box = bounds_from_record(Modal(), short, margin=margin).entries
    assert all(entry.lower < value < entry.upper for entry, value in zip(box, THETA, strict=True))
    assert [entry.upper / entry.lower for entry in box if entry.scale == "log"] == pytest.approx([margin**2] * 4)
    gains = [entry for entry in box if entry.unit == "m/N"]
    assert len({(entry.lower, entry.upper) for entry in gains}) == 1
    assert gains[0].upper == pytest.approx(margin * 6e-3, rel=0.05)
    assert gains[0].lower == -gains[0].upper


@pytest.mark.parametrize("margin", [1.0, np.nan, -2])
def test_a_margin_must_widen(margin):
    with pytest.raises(ValueError, match="margin is a factor above 1"):
        bounds_from_record(Modal(), RECORD, margin=margin)


def test_a_record_of_other_counts_is_refused():
    record = Record(T, np.zeros((5, 2)), np.zeros((6, 2)))
    said = "the record has 2 tensions and 2 outputs, but the model 3 and 2"
    for use in (lambda: prediction_error(Modal(), THETA, record), lambda: identify(Modal(), record)):
        with pytest.raises(ValueError, match=said):
            use()


def test_gains_of_cables_that_did_not_move_on_their_own_are_not_identified():
    alone = np.zeros((50, 3))
    alone[:, 0] = np.random.default_rng(1).normal(size=50)
    with pytest.raises(ValueError, match="vary in 1 independent ways"):
        identify(Modal(), Record(T, alone, np.random.default_rng(0).normal(size=(51, 2))))


def test_nothing_is_identified_from_tensions_that_never_change():
    with pytest.raises(ValueError, match="vary in 0 independent ways"):
        identify(Modal(), Record(T, np.full((50, 3), 2.0), np.random.default_rng(0).normal(size=(51, 2))))


def table(rows, columns, hole=None):
    values = np.zeros((rows, columns))
    if hole is not None:
        values[hole, 0] = np.nan
    return values


@pytest.mark.parametrize(
    ("tension", "output", "sample_time", "said"),
    [
        (table(5, 3), table(5, 2), T, r"a record of 5 samples has 6 rows of outputs .*, not 5"),
        (np.zeros(5), table(6, 2), T, r"tension of a record is a table .* not of shape \(5,\)"),
        (table(5, 3), np.zeros((6, 0)), T, "output of a record is a table"),
        (table(0, 3), table(1, 2), T, "tension of a record is a table"),
        (table(5, 3, 2), table(6, 2), T, "tension of a record must be finite, but row 2 is"),
        (table(5, 3), table(6, 2, 4), T, "output of a record must be finite, but row 4 is"),
        (table(5, 3), table(6, 2), 0.0, "sample_time of a record must be positive, not 0.0 s"),
        (table(5, 3), table(6, 2), np.inf, "sample_time of a record must be positive, not inf s"),
    ],
)
def test_a_damaged_record_is_refused(tension, output, sample_time, said):
    with pytest.raises(ValueError, match=said):
        Record(sample_time, tension, output)


def test_a_record_keeps_its_own_numbers():
    tension = np.zeros((3, 3))
    record = Record(T, tension, np.zeros((4, 2)))
    tension[0, 0] = 5.0
    assert record.tension[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        record.tension[0, 0] = 1.0
