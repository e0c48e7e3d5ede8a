"""The house: which room may import which, read from the imports themselves."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import socasadi

PACKAGE = Path(socasadi.__file__).parent
CORE = {"numpy", "scipy"}
ROOMS = {
    "codegen": {"casadi"},
    "rod": {"casadi", "codegen"},
    "plant": {"rod", "codegen"},
    "model": {"casadi"},
    "mpc": {"casadi", "model", "codegen"},
    "tune": {"GPy", "casadi"},
    "export": {"mpc", "codegen"},
    "campaign": {"plant", "model", "mpc", "tune", "export"},
    "feasibility": {"rod", "plant", "model", "mpc", "campaign"},
    "baselines": {"rod", "plant", "model", "mpc", "tune", "campaign"},
    "report": {"rod", "plant", "campaign", "baselines", "feasibility", "matplotlib"},
}
# What a room is made of beyond its table: libraries that serve one purpose in one room.
LIBRARIES = {
    "baselines": {"threadpoolctl"},
    "campaign": {"distributed"},
    "codegen": {"platformdirs"},
    "export": {"jinja2"},
    "model": {"sippy_unipi", "threadpoolctl"},
    "report": {"PIL", "imageio_ffmpeg", "jinja2", "plotly"},
    "tune": {"threadpoolctl"},
}
# casadi is the language of everything symbolic, and a model's matrices are part of what is exported. Whether single
# precision does is tried by the very test of the export. A nonlinear MPC compiles the derivatives of a rod.
GRANTED = {
    "plant": {"casadi"},
    "export": {"model"},
    "baselines": {"casadi", "codegen"},
    "feasibility": {"casadi", "codegen", "export"},
    "report": {"casadi", "tune"},
}


def modules(file: Path) -> set[tuple[str, ...]]:
    """The absolute names, split at the dots, of the modules that a file imports."""
    package = ("socasadi", *file.parent.relative_to(PACKAGE).parts)
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {tuple(alias.name.split(".")) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            named = tuple(node.module.split(".")) if node.module else ()
            found |= {(*base, *named)} if named else {(*base, alias.name) for alias in node.names}
    return found


def imports(file: Path) -> set[str]:
    """Names of the other rooms and of the third-party packages that a file imports."""
    own = file.relative_to(PACKAGE).parts[0]
    names = {module[1] if module[0] == "socasadi" else module[0] for module in modules(file)}
    return names - {own, "__future__"} - sys.stdlib_module_names


def test_every_room_stands_in_the_table():
    rooms = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").exists()}
    assert rooms == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_arrows_run_one_way(room):
    allowed = CORE | ROOMS[room] | LIBRARIES.get(room, set()) | GRANTED.get(room, set())
    for file in (PACKAGE / room).rglob("*.py"):
        assert imports(file) <= allowed, f"{file.relative_to(PACKAGE)} imports {imports(file) - allowed}"


def test_private_modules_are_imported_only_within_their_own_folder():
    for file in PACKAGE.rglob("*.py"):
        here = ("socasadi", *file.parent.relative_to(PACKAGE).parts)
        for module in modules(file):
            private = next((i for i, part in enumerate(module) if part.startswith("_")), None)
            if module[0] == "socasadi" and private is not None:
                assert here[:private] == module[:private], f"{file.name} reaches into {'.'.join(module)}"


def test_within_the_rod_equations_follow_from_the_body_and_never_the_other_way():
    for file in (PACKAGE / "rod" / "body").glob("*.py"):
        assert not any(module[:3] == ("socasadi", "rod", "mechanics") for module in modules(file)), file.name


def test_a_method_to_compare_is_one_file_of_less_than_150_lines():
    lengths = {file.name: len(file.read_text().splitlines()) for file in (PACKAGE / "baselines/methods").glob("*.py")}
    assert max(lengths.values()) < 150, lengths


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        ("socasadi", ("GPy", "matplotlib", "rich", "scipy.stats", "typer")),
        ("socasadi.cli", ("GPy", "matplotlib", "plotly", "scipy.stats")),
    ],
)
def test_importing_leaves_the_slow_parts_for_later(module, slow):
    code = f"import sys, {module}; print([m for m in {slow} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
