import matplotlib.image
import numpy as np
import pytest

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.report import figures, save_figures


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    study = Study(
        plant=SimulatedPlant(Rod.preset("paper")),
        mpc=LinearMPC(Modal()),
        task=Circle(duration=2.0),
        seed_points=4,
        iterations=0,
    )
    return study.run(tmp_path_factory.mktemp("figures") / "run", progress=None)


def curve(figure, label, row=0):
    (line,) = [line for line in figure.axes[row].lines if line.get_label() == label]
    return np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)


def test_convergence_marks_the_incumbent_and_tells_seed_points_apart(result):
    drawn = figures(result, baseline=result.trials)["convergence"]
    costs = [trial.J for trial in result.trials]
    np.testing.assert_allclose(curve(drawn, "best so far")[1], np.minimum.accumulate(costs))
    np.testing.assert_allclose(curve(drawn, "seed point")[1], costs)
    assert "best of Sobol points" in {line.get_label() for line in drawn.axes[0].lines}
    assert drawn.axes[0].get_yscale() == "log"


def test_responses_show_truth_reference_and_bounds_in_millimetres(result):
    episode = result.episode(result.best.number)
    drawn = figures(result)["responses"]
    for row in (0, 1):
        time, truth = curve(drawn, "true", row)
        np.testing.assert_allclose(time, episode.time)
        np.testing.assert_allclose(truth, 1e3 * episode.truth[:, row])
        np.testing.assert_allclose(curve(drawn, "bounds", row)[1], -100)
        assert drawn.axes[row].get_ylabel().endswith("/ mm")


def test_inputs_show_every_cable_and_the_bounds(result):
    drawn = figures(result)["inputs"]
    episode = result.episode(result.best.number)
    for j in range(3):
        np.testing.assert_allclose(curve(drawn, f"cable {j + 1}")[1], episode.tension[:, j])
    assert drawn.axes[0].get_ylabel() == "tension / N"


def test_another_trial_can_be_drawn(result):
    other = next(trial.number for trial in result.trials if trial.number != result.best.number)
    drawn = figures(result, trial=other)["path"]
    np.testing.assert_allclose(curve(drawn, "tip")[0], 1e3 * result.episode(other).truth[:, 0])


def test_figures_are_written_at_a_columns_width_with_ink_and_margins(result, tmp_path):
    files = save_figures(figures(result), tmp_path)
    assert {file.suffix for file in files} == {".png", ".pdf"}
    for file in files:
        if file.suffix == ".png":
            pixels = matplotlib.image.imread(file)[:, :, :3].mean(axis=2)
            assert abs(pixels.shape[1] - 88 / 25.4 * 300) <= 2
            assert (pixels < 0.5).any()
            edges = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
            assert (edges == 1).all(), f"{file.name} is cut off"
