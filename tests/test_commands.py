"""Every command that the pages show exists, and so do its options."""

import re
from pathlib import Path

import pytest
import typer

from socasadi import cli

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "studies/README.md", "studies/guide.md")
COMMANDS = typer.main.get_command(cli.app).commands  # pyright: ignore[reportAttributeAccessIssue] (it is a group)
COMMAND = r"(?<![\w.-])socasadi ([a-z]+)(?![\w-])"
OPTION = r"(?<![\w-])--[a-z][a-z-]*"


def shown(page: str) -> list[tuple[str, str]]:
    """What names commands, with its place: lines of code blocks, cells of tables, code in sentences."""
    found, fenced = [], False
    for number, line in enumerate((ROOT / page).read_text().splitlines(), 1):
        if line.startswith("```"):
            fenced = line == "```" and not fenced  # a block of a language is none of the shell's
            continue
        if fenced:
            pieces = [line.split("#")[0]]
        elif line.startswith("|"):  # the options of a command may stand in code of their own
            pieces = [" ".join(re.findall(r"`([^`]+)`", cell)) for cell in re.split(r"(?<!\\)\|", line)]
        else:
            pieces = re.findall(r"`([^`]+)`", line)
        found += [(f"{page}:{number}", piece) for piece in pieces if re.search(COMMAND, piece)]
    return found


def options(command: str) -> set[str]:
    return {option for parameter in COMMANDS[command].params for option in parameter.opts}


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_shows_can_be_typed(page):
    pieces = shown(page)
    assert pieces
    for place, piece in pieces:
        named = re.findall(COMMAND, piece)
        unknown = [command for command in named if command not in COMMANDS]
        assert not unknown, f"{place}: there is no command {unknown}"
        known = set().union(*map(options, named))
        wrong = set(re.findall(OPTION, piece.replace("pip install", ""))) - known
        assert not wrong, f"{place}: {', '.join(named)} has no {wrong}"


def test_the_readme_shows_every_command():
    named = {command for _, piece in shown("README.md") for command in re.findall(COMMAND, piece)}
    assert named == set(COMMANDS)
