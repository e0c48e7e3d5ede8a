import re
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from socasadi import Circle, LinearMPC, Modal, Rod, SimulatedPlant, Study
from socasadi.report import animate


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    study = Study(
        plant=SimulatedPlant(Rod.preset("paper")),
        mpc=LinearMPC(Modal()),
        task=Circle(duration=2.0),
        seed_points=3,
        iterations=0,
    )
    return study.run(tmp_path_factory.mktemp("animation") / "run", progress=None)


@pytest.fixture(scope="module")
def frames(result, tmp_path_factory):
    """The frames of the best episode's GIF, and the seconds for which each is shown."""
    return read(animate(result, tmp_path_factory.mktemp("gif") / "best.gif"))


def read(file):
    with Image.open(file) as image:
        seconds, pixels = [], []
        for k in range(image.n_frames):
            image.seek(k)
            seconds.append(image.info["duration"] / 1e3)
            pixels.append(np.asarray(image.convert("RGB"), dtype=int))
    return np.array(pixels), np.array(seconds)


def blue(pixels):
    """Where the tip and its way are."""
    return (np.abs(pixels - [0x00, 0x72, 0xB2]) < 8).all(axis=-1)


def test_a_gif_shows_an_episode_in_real_time_from_its_start_to_its_end(frames):
    pixels, seconds = frames
    assert pixels.shape == (21, 720, 1280, 3)
    np.testing.assert_allclose(seconds, 0.1)


def test_nothing_is_cut_off_at_the_edges(frames):
    pixels, _ = frames
    edges = [pixels[:, 0], pixels[:, -1], pixels[:, :, 0], pixels[:, :, -1]]
    assert all((edge == 255).all() for edge in edges)


def test_the_tip_leaves_its_way_behind_in_space_and_in_the_plane_and_the_tensions_grow(frames):
    pixels, _ = frames
    for panel in np.s_[:, :, :600], np.s_[:, 50:420, 690:1040], np.s_[:, 505:645, 690:]:
        seen = [blue(pixels[k][panel[1:]]).sum() for k in (0, 10, 20)]
        assert seen[0] < seen[1] < seen[2]


def test_the_rod_moves_between_its_recorded_shapes(result, frames):
    episode = result.episode(result.best.number)
    np.testing.assert_allclose(episode.shape_time, 0.25 * np.arange(9))
    rods = frames[0][:, 70:600, 150:450].reshape(21, -1)
    assert all((one != next_one).any() for one, next_one in pairwise(rods))


def test_an_mp4_lasts_as_long_as_the_episode_and_its_last_frame(result, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    counted = []
    file = animate(result, tmp_path / "new" / "best.mp4", progress=lambda *done: counted.append(done))
    reader = imageio_ffmpeg.read_frames(str(file))
    about = next(reader)
    assert about["size"] == (1280, 720)
    assert about["fps"] == 25
    assert about["duration"] == pytest.approx(2.04, abs=0.01)
    assert sum(1 for _ in reader) == 51
    assert counted == [(k, 51) for k in range(1, 52)]


def test_a_robot_without_shapes_has_its_path_and_its_tensions(toy_study, tmp_path):
    study = replace(toy_study, seed_points=3, iterations=0)
    pixels, _ = read(animate(study.run(tmp_path / "run", progress=None), tmp_path / "toy.gif"))
    assert len(pixels) == 11
    assert blue(pixels[-1][:, 110:600]).sum() > blue(pixels[0][:, 110:600]).sum() > 0
    assert (np.concatenate([pixels[:, :, 0], pixels[:, :, -1]], axis=1) == 255).all()


def test_another_suffix_and_a_missing_ffmpeg_are_answered_by_one_sentence(result, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=re.escape("best.avi ends in '.avi'; take .gif or .mp4")):
        animate(result, tmp_path / "best.avi")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ValueError, match=r"ffmpeg.*pip install 'socasadi\[video\]'.*or take \.gif"):
        animate(result, tmp_path / "best.mp4")


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_what_is_broken_off_leaves_no_file_and_keeps_the_one_before(result, tmp_path, suffix):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    file = tmp_path / f"best{suffix}"
    file.write_text("of yesterday")

    def interrupt(done, total):
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animate(result, file, progress=interrupt)
    assert file.read_text() == "of yesterday"
    assert list(tmp_path.iterdir()) == [file]


def test_an_ffmpeg_that_fails_is_quoted(result, tmp_path, monkeypatch):
    script = tmp_path / "bin" / "ffmpeg"
    script.parent.mkdir()
    script.write_text("#!/bin/sh\necho 'Unknown encoder libx264' >&2\nexit 1\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(script.parent), prepend=":")
    with pytest.raises(OSError, match=r"could not write an \.mp4, take \.gif: Unknown encoder libx264"):
        animate(result, tmp_path / "best.mp4")
    assert list(tmp_path.iterdir()) == [script.parent]
