"""The house: which room may import which, read from the imports themselves."""

import ast
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
    "report": {"rod", "plant", "campaign", "baselines", "feasibility", "matplotlib"},
}
# What a room is made of beyond its table: libraries that serve one purpose in one room.
LIBRARIES = {"codegen": {"platformdirs"}, "export": {"jinja2"}, "tune": {"threadpoolctl"}}
# casadi is the language of everything symbolic, and a model's matrices are part of what is exported.
GRANTED = {"plant": {"casadi"}, "export": {"casadi", "model"}}


def imports(file: Path) -> set[str]:
    """Names of the rooms and of the third-party packages that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.level == 2:
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
    import sys

    return {name for name in found if name not in sys.stdlib_module_names and name != "__future__"}


def test_every_room_stands_in_the_table():
    rooms = {folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").exists()}
    assert rooms == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_arrows_run_one_way(room):
    allowed = CORE | ROOMS[room] | LIBRARIES.get(room, set()) | GRANTED.get(room, set())
    for file in (PACKAGE / room).rglob("*.py"):
        assert imports(file) <= allowed, f"{file.relative_to(PACKAGE)} imports {imports(file) - allowed}"


def test_no_private_module_is_imported_from_another_room():
    for file in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and (node.level == 2 or "socasadi" in node.module):
                parts = node.module.removeprefix("socasadi.").split(".")
                assert not any(part.startswith("_") for part in parts), f"{file.name} reaches into {node.module}"


def test_importing_the_package_leaves_the_slow_parts_for_later():
    import subprocess
    import sys

    code = "import sys, socasadi; print([m for m in ('GPy', 'matplotlib', 'rich', 'typer') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
