"""Frames to a film: a .gif or an .mp4 file that is there whole or not at all."""

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image  # comes with matplotlib

from ._style import BLACK, GREY, INPUT_COLOURS

# Frames a second; a GIF's delays are whole hundredths of a second, and every frame of it is dear.
RATES = {".gif": 10, ".mp4": 25}

_SHADES = 28  # of each colour on its way to white: what drawing with soft edges makes


def film_writer(file: Path) -> Callable[[Iterable[np.ndarray], float], None]:
    """What writes frames (height, width, 4), each valid until the next, at a rate in 1/s, to ``file``.

    Raises
    ------
    ValueError
        The suffix is neither .gif nor .mp4, or there is no ffmpeg for an .mp4.
    """
    if file.suffix.lower() not in RATES:
        raise ValueError(f"the animation {file} ends in {file.suffix!r}; take {' or '.join(RATES)}")
    ffmpeg = _ffmpeg() if file.suffix.lower() == ".mp4" else ""

    def write(frames: Iterable[np.ndarray], rate: float) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_name(f"{file.name}.part")
        try:
            if ffmpeg:
                _write_mp4(frames, rate, part, ffmpeg)
            else:
                _write_gif(frames, rate, part)
            part.replace(file)
        finally:
            part.unlink(missing_ok=True)

    return write


def _ffmpeg() -> str:
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise ValueError(
            "an .mp4 needs ffmpeg, and there is none: install it (pip install 'socasadi[video]') or take .gif"
        ) from None


def _write_mp4(frames: Iterable[np.ndarray], rate: float, file: Path, ffmpeg: str) -> None:
    frames = iter(frames)
    first = next(frames)
    height, width, _ = first.shape
    taken = ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{rate}", "-i", "-"]
    # yuv420p is what every player knows, and an index at the front lets a browser begin at once.
    made = ["-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", "-y"]
    command = [ffmpeg, "-loglevel", "error", *taken, *made, str(file)]
    # In a session of its own Ctrl-C does not reach it: it is ended here.
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        said = _piped(process, first, frames)
    except BaseException:
        process.kill()
        process.communicate()
        raise
    if process.returncode:
        reason = said.strip().splitlines()[-1] if said.strip() else f"it ended with {process.returncode}"
        raise OSError(f"ffmpeg ({ffmpeg}) could not write an .mp4, take .gif: {reason}")


def _piped(process: subprocess.Popen[bytes], first: np.ndarray, frames: Iterator[np.ndarray]) -> str:
    """What ``process`` said to the frames."""
    assert process.stdin is not None
    try:
        process.stdin.write(first.tobytes())
        for frame in frames:
            process.stdin.write(frame.tobytes())
    except BrokenPipeError:
        pass  # it has ended, and says why
    return process.communicate()[1].decode(errors="replace")


def _write_gif(frames: Iterable[np.ndarray], rate: float, file: Path) -> None:
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette())

    def indexed() -> Iterator[Image.Image]:
        for frame in frames:
            # One palette for all, without dither: what stands still is the same in each, and takes no space.
            yield Image.fromarray(frame[:, :, :3]).quantize(palette=palette, dither=Image.Dither.NONE)

    images = indexed()
    next(images).save(
        file, format="GIF", save_all=True, append_images=images, duration=round(1000 / rate), loop=0, optimize=True
    )


def _palette() -> list[int]:
    """Red, green, blue of less than 256 colours: one is left for what does not change between frames."""
    colours = np.array([to_rgb(colour) for colour in dict.fromkeys((BLACK, GREY, *INPUT_COLOURS))])
    share = np.linspace(0, 0.85, _SHADES)[:, None, None]  # Pillow would take what is closer to white for white
    shades = np.rint(255 * ((1 - share) * colours + share)).astype(int)
    return [*shades.ravel().tolist(), 255, 255, 255]
