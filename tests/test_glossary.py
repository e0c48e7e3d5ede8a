"""The table of the paper's symbols: the package's docstring and studies/README.md agree, and every name exists."""

import dataclasses
import importlib
import inspect
import re
from pathlib import Path

import pytest

import socasadi

ROOMS = [
    socasadi,
    *(importlib.import_module(f"socasadi.{room}") for room in ["rod", "plant", "model", "mpc", "campaign", "tune"]),
]


def of_the_docstring() -> list[tuple[str, ...]]:
    assert socasadi.__doc__
    lines = socasadi.__doc__.split("\n")
    first, second, third = (i for i, line in enumerate(lines) if re.fullmatch(r"=+( +=+)+", line))
    spans = [match.span() for match in re.finditer(r"=+", lines[first])]
    assert second == first + 2
    return [tuple(line[start:end].strip() for start, end in spans) for line in lines[second + 1 : third]]


def of_the_page() -> list[tuple[str, ...]]:
    page = (Path(__file__).parents[1] / "studies" / "README.md").read_text()
    section = page.split("\n## The paper's symbols\n")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [tuple(cell.strip() for cell in row.strip("|").split("|")) for row in rows]


def names() -> list[str]:
    return [name for _, cell, _ in of_the_page() for name in re.findall(r"`([^`]+)`", cell)]


def test_the_docstring_and_the_page_hold_the_same_table():
    assert [(s, n.replace("``", "`"), m) for s, n, m in of_the_docstring()] == of_the_page()
    assert len(names()) > 30


@pytest.mark.parametrize("name", names())
def test_every_name_exists_as_an_attribute_a_field_or_a_parameter(name):
    owner, *parts = name.split(".")
    (found, *_) = [getattr(room, owner) for room in ROOMS if owner in getattr(room, "__all__", ())] or [None]
    assert found is not None, f"no room has a public {owner}"
    for part in parts:
        fields = {field.name for field in dataclasses.fields(found)} if dataclasses.is_dataclass(found) else set()
        parameters = set(inspect.signature(found).parameters) if callable(found) else set()
        members = set(vars(found)) | fields | set(getattr(found, "__annotations__", {})) | set(dir(found))
        assert part in members | parameters, f"{name}: {part} is no member, field or parameter"
        found = getattr(found, part, None)
