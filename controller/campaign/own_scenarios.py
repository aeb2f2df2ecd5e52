"""Scenario files of one's own in a campaign, beside or in place of the families."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from config.app import AppConfig
from config.loader import ConfigError
from config.scenario import Scenario, as_yaml, load_scenario
from controller.errors import UserError
from controller.mission.close_by import close_by_warning
from controller.mission.options import scenario_as_typed
from controller.mission.possible_world import require_possible_world
from controller.mission.short_arcs import short_arc_warning
from controller.mission.unseen_bodies import unseen_bodies_warning
from controller.terminal.outlet import say

KEPT = "scenarios"


@dataclass(frozen=True, slots=True)
class OwnScenario:
    """One of --scenario: given is what the user wrote, scenario what is in that file."""

    given: str
    scenario: Scenario


def label_of(given: str) -> str:
    """Its name in place of a family's: that of the file, which no family has, since it ends in .yaml."""
    name = Path(given).name
    return name if name.endswith((".yaml", ".yml")) else f"{name}.yaml"


def load_own(given: Sequence[str], config: AppConfig) -> dict[str, OwnScenario]:
    """The scenarios by their labels, in this order. Tells what is doubtful about their paths.

    Raises ConfigError, PathError, UserError.
    """
    own: dict[str, OwnScenario] = {}
    for one in given:
        label = label_of(one)
        if label in own:
            raise UserError(
                f"--scenario {one}: another one is called {label}, too ({own[label].given}); rename a file, "
                "since the report tells them apart by this name"
            )
        own[label] = OwnScenario(one, load_scenario(one))
        in_it = _in_this_world(config, one)
        require_possible_world(in_it)
        for told in (short_arc_warning, close_by_warning, unseen_bodies_warning):
            warning = told(in_it)
            if warning is not None:
                say(f"treadwatch: warning: {warning}", to_stderr=True)
    return own


def _in_this_world(config: AppConfig, given: str) -> AppConfig:
    assert config.simulation is not None, "AppConfig asks for one with a simulated camera"
    changed = config.simulation.model_copy(update={"scenario": scenario_as_typed(given)})
    return config.model_copy(update={"simulation": changed})


def keep_own(folder: Path, own: Mapping[str, OwnScenario], driven: set[str]) -> None:
    """Copy the scenarios into a report's folder.

    driven: labels of which the report has rows already. Raises UserError, also where those were driven with
    other content.
    """
    kept = folder / KEPT
    for label, one in own.items():
        file = kept / label
        try:
            if label in driven and file.exists():
                if load_scenario(file) == one.scenario:
                    continue
                raise UserError(
                    f"{one.given}: {folder} was driven with another content of it, which is in {file}; "
                    "go on with that one, or give another --report folder"
                )
            kept.mkdir(exist_ok=True)
            file.write_text(as_yaml(one.scenario), encoding="utf-8")
        except OSError as error:
            raise UserError(f"{file}: {error.strerror}; choose a folder that can be written") from error
        except ConfigError as error:
            raise UserError(f"{error}; remove it, or give another --report folder") from error


def kept_scenarios(folder: Path) -> dict[str, Scenario]:
    """All that were ever driven into this report, by their labels. Raises ConfigError."""
    return {file.name: load_scenario(file) for file in sorted((folder / KEPT).glob("*.y*ml"))}
