import click
import pytest
from click.testing import CliRunner

from controller.cli.commands import cli

RECORDED = ("--observations", "--video", "--quiet")


def shown(*arguments: str) -> str:
    done = CliRunner().invoke(cli, [*arguments, "--help"], terminal_width=80)
    assert done.exit_code == 0
    return done.output


def test_every_command_is_listed_with_a_whole_sentence() -> None:
    lines = shown().split("Commands:\n")[1].splitlines()
    assert {line.split()[0] for line in lines} == set(cli.commands)
    assert all(line.endswith(".") and not line.endswith("...") for line in lines), lines


@pytest.mark.parametrize("name", sorted(cli.commands))
def test_every_option_says_what_it_does(name: str) -> None:
    assert shown(name).startswith(f"Usage: cli {name} ")
    options = [one for one in cli.commands[name].params if isinstance(one, click.Option)]
    assert [one.name for one in options if not one.help] == []


@pytest.mark.parametrize("name", ["run", "watch", "govern", "replay"])
def test_all_commands_offer_the_same_recordings(name: str) -> None:
    listed = [one.opts[0] for one in cli.commands[name].params]
    assert tuple(option for option in listed if option in RECORDED) == RECORDED
