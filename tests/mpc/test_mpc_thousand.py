"""A thousand random tracking problems: four back ends, one answer."""

import numpy as np
import pytest

from socasadi import LinearMPC, Modal
from socasadi.mpc import BACKENDS

FAMILY = Modal()


def random_specification(rng):
    """Any kind of MPC on any kind of arm."""
    lower, upper = np.array([(e.lower, e.upper) for e in FAMILY.entries]).T
    scales = np.exp(rng.uniform(np.log(np.maximum(lower, 1e-3)), np.log(upper)))
    gains = rng.uniform(0.1, 0.7, FAMILY.size) * rng.choice([-1, 1], FAMILY.size) * upper
    theta = np.where(lower > 0, scales, gains)
    horizon = int(rng.integers(3, 16))
    settings = {
        "horizon": horizon,
        "control_horizon": int(rng.integers(1, horizon + 1)),
        "preview": int(rng.integers(1, horizon + 1)),
        "R": 10 ** rng.uniform(-1, 1),
        "input_term": str(rng.choice(["rate", "normalised"])),
        "rate_weight": float(rng.choice([0.0, 1.0])),
        "input_bounds": (0.0, 10.0) if rng.random() < 0.3 else (-rng.uniform(2, 10), rng.uniform(2, 10)),
        "rate_bounds": (-rng.uniform(20, 100), rng.uniform(20, 100)) if rng.random() < 0.4 else None,
        "output_bounds": (-rng.uniform(0.02, 0.1), rng.uniform(0.02, 0.1)) if rng.random() < 0.8 else None,
        "slack_weight": 10 ** rng.uniform(4, 6),
        "slack_linear": float(rng.choice([0.0, 100.0])),
        "terminal": "riccati" if rng.random() < 0.7 else None,
        "delay": int(rng.integers(0, 3)),
    }
    return settings, theta


@pytest.mark.parametrize("seed", range(20))
def test_the_back_ends_give_one_answer_to_fifty_random_tracking_problems(seed):
    rng = np.random.default_rng(seed)
    settings, theta = random_specification(rng)
    controllers = {name: LinearMPC(FAMILY, backend=name, **settings).controller(theta) for name in BACKENDS}
    mpc = controllers["qpoases"].mpc
    gave_up = dict.fromkeys(BACKENDS, 0)
    for _ in range(50):
        held, y = rng.uniform(*mpc.input_limits), rng.uniform(-0.06, 0.06, 2)
        reference = rng.uniform(-0.08, 0.08, 2) + rng.uniform(-0.02, 0.02, (mpc.reference_rows, 2))
        answers = {}
        for name, controller in controllers.items():
            controller.reset(held)
            answers[name] = controller.step(y, reference)
            gave_up[name] += controller.info.fallbacks
        for name, u in answers.items():
            assert np.allclose(u, answers["qpoases"], rtol=0, atol=1e-5 * mpc.input_scale.max()), name
    assert gave_up == dict.fromkeys(BACKENDS, 0)
