import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_rgb

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


def test_inputs_are_told_apart_in_grey_and_named_at_their_lines(result):
    drawn = figures(result)["inputs"].axes[0]
    cables = [line for line in drawn.lines if str(line.get_label()).startswith("cable")]
    grey = sorted(float(np.dot(to_rgb(line.get_color()), (0.299, 0.587, 0.114))) for line in cables)
    assert np.diff(grey).min() > 0.15
    episode = result.episode(result.best.number)
    for j, text in enumerate(drawn.texts):
        k = int(np.argmin(np.abs(episode.time[:-1] - text.get_position()[0])))
        assert (text.get_text(), text.get_position()[1]) == (str(j + 1), episode.tension[k, j])
    assert len(drawn.texts) == len(cables)
    # The last instant of the task is on the axis, with its tick.
    assert drawn.get_xlim() == (0, 2)
    assert 2.0 in drawn.get_xticks()


def test_figures_say_which_trial_they_show(result):
    best = result.best.number
    drawn = figures(result)
    for name in ("responses", "path", "inputs", "shapes"):
        assert [text.get_text() for text in drawn[name].texts] == [f"trial {best}"]
    assert drawn["convergence"].axes[0].texts[0].get_text() == f"{result.best.J:.3g}, trial {best}"
    assert [text.get_text() for text in figures(result, trial=3)["inputs"].texts] == ["trial 3"]


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
