"""The examples in the docstrings do what they show."""

import doctest
import importlib
import pkgutil

import pytest

import socasadi.rod

MODULES = ["socasadi.rod", *(m.name for m in pkgutil.walk_packages(socasadi.rod.__path__, "socasadi.rod."))]


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples(name):
    failed, _ = doctest.testmod(importlib.import_module(name), extraglobs=vars(socasadi.rod))
    assert failed == 0


def test_every_capability_has_an_example():
    """What the package exports, but for results and protocols, shows how it is used."""
    results = {"Basis", "Equilibrium", "EquilibriumError", "Linearisation", "Modes", "RodModel"}
    plain = {"Material", "cables_around", "piecewise_constant", "piecewise_linear"}  # shown in the examples of others
    for name in set(socasadi.rod.__all__) - results - plain:
        assert ">>>" in (getattr(socasadi.rod, name).__doc__ or ""), name
