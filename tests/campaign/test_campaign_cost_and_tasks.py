from dataclasses import replace

import numpy as np
import pytest

from socasadi.campaign import Circle, Cost, Episode, Origin, Pulse


def episode(output, reference, tension, held=(0.0, 0.0, 0.0), truth=None, sample_time=1.0):
    output, reference = np.asarray(output, float), np.asarray(reference, float)
    return Episode(
        sample_time=sample_time,
        output=output,
        reference=reference,
        truth=output if truth is None else np.asarray(truth, float),
        tension=np.asarray(tension, float),
        held=np.asarray(held, float),
        shapes=np.zeros((0, 21, 3)),
    )


class TestCost:
    flown = episode(
        output=[[9, 9], [0.1, 0], [0, 0.2]],
        reference=[[0, 0], [0, 0], [0, 0]],
        tension=[[2, 0, 0], [2, -4, 0]],
        held=[1, 0, 0],
    )
    scale = np.array([10.0, 10.0, 10.0])

    def test_tracking_counts_the_outputs_after_each_input_and_not_the_one_before_the_first(self):
        assert pytest.approx(100 * (0.01 + 0.04)) == Cost(Q=100, R=0).score(self.flown, self.scale).J

    @pytest.mark.parametrize(
        ("term", "by_hand"),
        [("literal", 4 + 4 + 16), ("normalised", (4 + 4 + 16) / 100), ("rate", (1 + 16) / 100)],
    )
    def test_the_input_term_weighs_newtons_shares_or_changes_of_shares(self, term, by_hand):
        score = Cost(Q=0, R=1, input_term=term).score(self.flown, self.scale)
        assert score.effort == pytest.approx(by_hand)
        assert pytest.approx(by_hand) == score.J

    def test_the_literal_cost_stands_beside_whatever_term_is_chosen(self):
        assert Cost(Q=100, R=1, input_term="rate").score(self.flown, self.scale).literal == pytest.approx(5 + 24)

    def test_rmse_is_of_the_true_output_after_five_seconds(self):
        truth = np.zeros((9, 2))
        truth[:6] = 7.0
        truth[6:] = [0.003, 0.004]
        flown = episode(np.ones((9, 2)), np.zeros((9, 2)), np.zeros((8, 3)), truth=truth)
        assert Cost().score(flown, self.scale).rmse == pytest.approx(0.005)

    def test_matrix_weights_are_quadratic_forms(self):
        Q = ((2.0, 1.0), (1.0, 3.0))
        flown = episode([[0, 0], [1, 2]], np.zeros((2, 2)), np.zeros((1, 3)))
        assert pytest.approx(2 + 4 + 12) == Cost(Q=Q, R=0).score(flown, self.scale).J

    def test_an_unknown_input_term_is_named(self):
        with pytest.raises(ValueError, match=r"unknown input_term 'effort'; there are rate, normalised, literal"):
            Cost(input_term="effort")  # pyright: ignore[reportArgumentType]


class TestTasks:
    def test_the_circle_starts_on_y_and_turns_towards_z(self):
        rows = Circle(radius=0.05, period=20.0).reference(np.array([0.0, 5.0, 10.0, 20.0]))
        np.testing.assert_allclose(rows, [[0.05, 0], [0, 0.05], [-0.05, 0], [0.05, 0]], atol=1e-15)

    def test_the_origin_is_reached_from_a_pose_and_the_circle_from_rest(self):
        assert Origin().start == (-0.01, 0.04)
        assert Circle().start is None
        assert not Origin().reference(np.arange(3.0)).any()

    def test_a_pulse_acts_on_the_samples_that_start_in_it(self):
        pulse = Pulse(time=1.0, duration=0.1, force=(0, 1, 0))
        acting = [t for t in range(40) if pulse.at(t * 0.05) != (0, 0, 0)]
        assert acting == [20, 21]

    @pytest.mark.parametrize(
        ("make", "words"),
        [
            (lambda: Circle(radius=-0.05), "radius of a circle must be positive, not -0.05"),
            (lambda: Circle(period=0.0), "period of a circle must be positive"),
            (lambda: Circle(radius="0.05"), "radius of a circle must be positive, not '0.05'"),
            (lambda: Origin(tip=(float("nan"), 0.0)), "tip of the origin task is 2 finite numbers"),
            (lambda: Origin(duration=float("nan")), "duration of a task must be positive, not nan"),
            (lambda: Pulse(time=0, duration=0, force=(0, 0, 0)), "a pulse starts"),
            (lambda: Pulse(time=0, duration=1, force=(0, float("inf"), 0)), "3 finite numbers"),
            (lambda: replace(Circle(), duration=0.01).samples(0.05), "shorter than one sample"),
        ],
    )
    def test_nonsense_is_refused_in_a_sentence(self, make, words):
        with pytest.raises(ValueError, match=words):
            make()
