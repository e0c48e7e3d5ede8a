"""Compiled Functions give the interpreted numbers, are compiled once, and fail in words."""

import multiprocessing
import os
import stat
import subprocess
import warnings
from math import cos, exp, sin

import casadi
import numpy as np
import pytest

from socasadi.codegen import Buffered, CompilationError, c_compiler, cache_directory, compiled
from socasadi.codegen import _compile as internals

needs_compiler = pytest.mark.skipif(c_compiler() is None, reason="no C compiler on this machine")


def wave(factor=1.0):
    x = casadi.SX.sym("x", 2)
    return casadi.Function(
        "wave", [x], [factor * casadi.sin(x[0]) * casadi.exp(-x[1]), casadi.cos(x)], ["x"], ["a", "b"]
    )


def build_in_child(barrier, results):
    barrier.wait()
    results.put(float(compiled(wave())([0.3, 0.2])[0]))


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("SOCASADI_CACHE", str(folder))
    return folder


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    internals.warn_interpreted.cache_clear()
    yield
    internals.warn_interpreted.cache_clear()


@needs_compiler
def test_machine_code_gives_the_interpreted_numbers():
    function = compiled(wave())
    assert function.class_name() == "External"
    assert (function.name_in(), function.name_out()) == (["x"], ["a", "b"])
    for x, y in np.random.default_rng(0).uniform(-3, 3, (50, 2)):
        a, b = function([x, y])
        assert float(a) == pytest.approx(sin(x) * exp(-y), rel=1e-14, abs=1e-300)
        assert np.allclose(b.full().ravel(), [cos(x), cos(y)], rtol=1e-14, atol=1e-16)


@needs_compiler
def test_the_same_function_is_compiled_once(monkeypatch, empty_cache):
    commands = []
    run = subprocess.run
    monkeypatch.setattr(internals.subprocess, "run", lambda command, **k: commands.append(command) or run(command, **k))
    compiled(wave())
    assert sum("wave.c" in command for command in commands) == 1
    again = compiled(wave())
    assert sum("wave.c" in command for command in commands) == 1
    assert float(again([0.5, 0])[0]) == pytest.approx(sin(0.5), rel=1e-14)
    assert [path.suffix for path in empty_cache.iterdir()] == [".so"]


@needs_compiler
def test_functions_of_one_name_are_told_apart_by_content():
    first, second = compiled(wave(1.0)), compiled(wave(2.0))
    assert float(second([0.3, 0.2])[0]) == pytest.approx(2 * float(first([0.3, 0.2])[0]), rel=1e-15)


@needs_compiler
def test_flags_are_part_of_what_is_cached(empty_cache):
    compiled(wave())
    compiled(wave(), flags=["-DANYTHING=1"])
    assert len(list(empty_cache.iterdir())) == 2


@needs_compiler
def test_a_library_made_for_another_processor_is_not_loaded(monkeypatch, empty_cache):
    compiled(wave())
    monkeypatch.setattr(internals, "_target", lambda compiler: ((), "#define __VERSION__ of another machine"))
    assert float(compiled(wave())([0.5, 0])[0]) == pytest.approx(sin(0.5), rel=1e-14)
    assert len(list(empty_cache.iterdir())) == 2


@needs_compiler
def test_processes_that_build_the_same_function_at_once_all_get_it(empty_cache):
    context = multiprocessing.get_context("spawn")
    barrier, results = context.Barrier(4), context.Queue()
    children = [context.Process(target=build_in_child, args=(barrier, results)) for _ in range(4)]
    for child in children:
        child.start()
    values = [results.get(timeout=60) for _ in children]
    for child in children:
        child.join()
    assert [child.exitcode for child in children] == [0] * 4
    assert values == pytest.approx([sin(0.3) * exp(-0.2)] * 4, rel=1e-14)
    assert len(list(empty_cache.iterdir())) == 1


def test_without_a_compiler_the_function_itself_is_returned_and_it_is_said_once(no_compiler):
    function = wave()
    assert c_compiler() is None
    with pytest.warns(RuntimeWarning, match="no C compiler found .* interpreted") as said:
        assert compiled(function) is function
    assert said[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compiled(function) is function


def test_the_compiler_named_by_CC_comes_first_with_its_arguments(monkeypatch, tmp_path):
    own = tmp_path / "mycc"
    own.write_text("#!/bin/sh\n")
    own.chmod(stat.S_IRWXU)
    monkeypatch.setenv("CC", f"{own} -O1")
    assert c_compiler() == [str(own), "-O1"]


def test_a_compiler_that_refuses_is_quoted_and_leaves_nothing_behind(monkeypatch, tmp_path, empty_cache):
    broken = tmp_path / "brokencc"
    broken.write_text(
        "#!/bin/sh\n[ \"$1\" = --version ] && echo broken 1.0 && exit 0\necho 'no such luck' >&2\nexit 1\n"
    )
    broken.chmod(stat.S_IRWXU)
    monkeypatch.setenv("CC", str(broken))
    with pytest.raises(CompilationError, match=r"(?s)brokencc .* failed on the C of 'wave':\nno such luck"):
        compiled(wave())
    assert list(empty_cache.iterdir()) == []


def test_the_cache_folder_is_made_on_demand(empty_cache):
    assert not empty_cache.exists()
    assert cache_directory() == empty_cache
    assert empty_cache.is_dir()


def test_a_cache_folder_that_cannot_be_made_is_named(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("SOCASADI_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(OSError, match=r"cache folder .*file/cache cannot be written to .*set SOCASADI_CACHE"):
        cache_directory()


@needs_compiler
def test_a_cache_folder_that_is_there_but_cannot_be_written_to_is_named(monkeypatch, tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    if os.access(folder, os.W_OK):
        # Nothing is closed to a superuser but a folder that is no real one.
        folder = "/proc/self"
    monkeypatch.setenv("SOCASADI_CACHE", str(folder))
    with pytest.raises(OSError, match=rf"cache folder {folder} cannot be written to .*set SOCASADI_CACHE"):
        compiled(wave())


def test_buffered_calls_give_what_plain_calls_give():
    function = wave()
    buffered = Buffered(function)
    x = np.array([0.4, -1.2])
    first = buffered(x)
    second = buffered(2 * x)
    for values, at in ((first, x), (second, 2 * x)):
        assert all(np.array_equal(v, w.full().ravel()) for v, w in zip(values, function(at), strict=True))
