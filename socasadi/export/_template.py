"""The text of the generated files."""

import importlib.metadata
from collections.abc import Sequence
from typing import Any

import jinja2
import numpy as np

from ..mpc import Tables
from ._kind import Kind


def data_facts(kind: Kind, given: Tables, provenance: Sequence[str]) -> dict[str, Any]:
    """What the template of the data header takes."""
    program = {f"qp_{array}": values for array, values in given.program.arrays.items()}
    arrays = {array: values for array, values in given.arrays.items() if values.size}
    tables = arrays | program
    return {
        "title": "Model predictive controller tuned by socasadi",
        "provenance": [*provenance, f"made by {', '.join(_versions(kind))}"],
        "name": kind.name,
        "NAME": kind.name.upper(),
        "real": kind.real,
        "osqp": kind.solver == "osqp",
        "tables": list(tables.items()),
        "arrays": list(arrays),
        "table_numbers": sum(values.size for values in tables.values()),
        **given.limits,
    }


def _versions(kind: Kind) -> list[str]:
    packages = ["socasadi", "casadi", "numpy", *(["osqp"] if kind.solver == "osqp" else [])]
    return [f"{package} {importlib.metadata.version(package)}" for package in packages]


def environment(real: str) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("socasadi.export"),
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=False,
    )
    suffix = "f" if real == "float" else ""

    def number(value: float) -> str:
        """A literal that reads back as the very same number."""
        text = str(np.float32(value)) if real == "float" else repr(float(value))
        return (text if any(sign in text for sign in ".en") else f"{text}.0") + suffix

    def initialiser(array: Sequence | np.ndarray) -> str:
        values = np.asarray(array, dtype=float)
        if values.ndim > 1:
            return "{\n    " + ",\n    ".join(initialiser(row) for row in values) + "}"
        lines = [", ".join(map(number, values[i : i + 8])) for i in range(0, len(values), 8)]
        return "{" + ",\n    ".join(lines) + "}"

    environment.filters |= {"c": initialiser, "number": number}
    return environment
