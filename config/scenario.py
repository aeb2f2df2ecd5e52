"""A simulated world as written in YAML: path, building, light, bodies, and what goes wrong in it."""

from __future__ import annotations

from collections import Counter
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Literal, Self

import yaml
from pydantic import Field, model_validator

from config.faults import NO_FAULTS, Faults
from config.loader import CONFIG_DIR, ConfigError, Section, load
from config.path import PathSpec

SCENARIO_DIR = CONFIG_DIR / "scenarios"

Texture = Literal["fine", "coarse", "plain"]
Metres = Annotated[float, Field(ge=-1e4, le=1e4)]
Size = Annotated[float, Field(gt=0, le=200)]
Seconds = Annotated[float, Field(ge=0, le=3600)]
Share = Annotated[float, Field(ge=0, le=1)]


class Go(Section):
    """Walk or drive straight to a point. A corner of less than 60 degrees is rounded in passing; at a sharper
    one the mover stops, turns on the spot and goes on."""

    kind: Literal["go"]
    x_m: Metres
    y_m: Metres
    speed_mps: float = Field(gt=0, le=10)


class Wait(Section):
    """Stand still."""

    kind: Literal["wait"]
    duration_s: Seconds


Step = Annotated[Go | Wait, Field(discriminator="kind")]


class MotionPlan(Section):
    """What a body does, step after step. start_jitter_s: the seed shifts the start by at most this, either
    way."""

    start_s: Seconds = 0.0
    start_jitter_s: Seconds = 0.0
    accel_mps2: float = Field(default=1.5, gt=0, le=20)
    turn_rate_degps: float = Field(default=150.0, gt=0, le=720)
    steps: Annotated[tuple[Step, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _starts_after_zero(self) -> Self:
        if self.start_jitter_s > self.start_s:
            raise ValueError(
                "start_jitter_s must not exceed start_s: the motion would begin before time zero"
            )
        return self


class _Placed(Section):
    """name must be unique; x, y: the middle of the footprint on the floor; z_m: height of its underside.

    texture: fine (printed cardboard, labels, fabric), coarse (large patches), plain (nothing to track).
    glass: colour shows the body, but depth has no valid pixel on it.
    """

    name: str = Field(min_length=1, max_length=40)
    x_m: Metres
    y_m: Metres
    z_m: float = Field(default=0.0, ge=0, le=50)
    heading_deg: float = Field(default=0.0, ge=-360, le=360)
    texture: Texture = "fine"
    glass: bool = False
    motion: MotionPlan | None = None


class Crate(_Placed):
    """A box: cardboard (fine), wood (coarse) or painted (plain). Length along its heading."""

    kind: Literal["crate"]
    length_m: Size = 0.6
    width_m: Size = 0.6
    height_m: Size = 0.6


class Shelf(_Placed):
    """A pallet rack with posts, beams and goods; its long side along the heading."""

    kind: Literal["shelf"]
    length_m: Size = 5.4
    width_m: Size = 1.1
    height_m: Size = 3.2
    levels: int = Field(default=3, ge=1, le=8)
    bay_m: float = Field(default=2.7, ge=0.5, le=10)
    goods: Share = Field(
        default=0.6,
        description="density of boxes that stand out of the painted goods; 1 fills half of the lowest level",
    )


class Column(_Placed):
    """A round pillar."""

    kind: Literal["column"]
    diameter_m: Size = 0.4
    height_m: Size = 5.0
    sides: int = Field(default=16, ge=3, le=48)


class Pole(_Placed):
    """A thin upright tube."""

    kind: Literal["pole"]
    diameter_m: Size = 0.05
    height_m: Size = 1.2
    texture: Texture = "plain"


class Pallet(_Placed):
    """A wooden pallet; with load_height_m > 0, wrapped goods on top."""

    kind: Literal["pallet"]
    length_m: Size = 1.2
    width_m: Size = 0.8
    height_m: Size = 0.144
    load_height_m: float = Field(default=0.0, ge=0, le=5)


class Wall(_Placed):
    """A flat wall; its long side along the heading."""

    kind: Literal["wall"]
    length_m: Size = 6.0
    width_m: Size = 0.2
    height_m: Size = 3.0
    texture: Texture = "plain"


class Beam(_Placed):
    """A bar that hangs at z_m over the floor; its long side along the heading."""

    kind: Literal["beam"]
    z_m: float = Field(default=1.6, ge=0, le=50)
    length_m: Size = 4.0
    width_m: Size = 0.2
    height_m: Size = 0.2


class Person(_Placed):
    """A walking person of several parts; faces the heading while standing."""

    kind: Literal["person"]
    height_m: float = Field(default=1.75, ge=0.8, le=2.3)


class RobotBody(_Placed):
    """Another transport robot on wheels; load_height_m: what it carries."""

    kind: Literal["robot"]
    length_m: Size = 1.1
    width_m: Size = 0.75
    height_m: Size = 0.55
    load_height_m: float = Field(default=0.0, ge=0, le=3)


BodySpec = Annotated[
    Crate | Shelf | Column | Pole | Pallet | Wall | Beam | Person | RobotBody, Field(discriminator="kind")
]


class TapeLine(Section):
    """A painted line on the floor from a to b."""

    ax_m: Metres
    ay_m: Metres
    bx_m: Metres
    by_m: Metres
    width_m: float = Field(default=0.08, gt=0, le=1)
    colour: Literal["yellow", "white", "red"] = "yellow"


class Room(Section):
    """The building, a box: floor at z = 0, four walls, a ceiling."""

    x_min_m: Metres = -4.0
    x_max_m: Metres = 32.0
    y_min_m: Metres = -6.0
    y_max_m: Metres = 6.0
    height_m: Size = 6.0
    floor: Texture = "fine"
    walls: Texture = "coarse"
    ceiling: Texture = "coarse"
    tape: Annotated[tuple[TapeLine, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _has_an_inside(self) -> Self:
        if self.x_min_m >= self.x_max_m or self.y_min_m >= self.y_max_m:
            raise ValueError("x_min_m and y_min_m must be smaller than x_max_m and y_max_m")
        return self

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether a point on the floor lies between the walls, or on one."""
        return self.x_min_m <= x_m <= self.x_max_m and self.y_min_m <= y_m <= self.y_max_m

    @property
    def in_words(self) -> str:
        """Where its walls are, for messages."""
        return f"x {self.x_min_m:g} to {self.x_max_m:g}, y {self.y_min_m:g} to {self.y_max_m:g}"


class Light(Section):
    """ambient: share of light that reaches every face alike; the rest comes down from the ceiling and from
    the side that azimuth_deg points to."""

    ambient: float = Field(default=0.55, ge=0, le=1)
    azimuth_deg: float = Field(default=115.0, ge=-360, le=360)
    exposure: float = Field(default=1.0, ge=0.1, le=2)


class Scenario(Section):
    """One world. duration_s and outcome are for campaigns: `treadwatch run` ends by the section runner.

    duration_s: after so long a campaign gives a mission up. outcome: whether a robot that drives well reaches
    its target, or something never leaves its path, and a campaign expects no arrival.
    """

    name: str = Field(min_length=1)
    description: str = ""
    duration_s: float = Field(default=120.0, gt=0, le=3600)
    outcome: Literal["target", "blocked"] = "target"
    path: PathSpec
    room: Room = Room()
    light: Light = Light()
    bodies: Annotated[tuple[BodySpec, ...], Field(strict=False)] = ()
    faults: Faults = NO_FAULTS

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        twice = [name for name, count in Counter(body.name for body in self.bodies).items() if count > 1]
        if twice:
            raise ValueError(f"body names must be unique; {', '.join(sorted(twice))} is given twice")
        return self


def scenario_names() -> tuple[str, ...]:
    """The scenarios that ship with the program."""
    return tuple(sorted(path.stem for path in SCENARIO_DIR.glob("*.yaml")))


def as_yaml(scenario: Scenario) -> str:
    """A scenario as the text of a file that load_scenario reads."""
    return yaml.safe_dump(scenario.model_dump(mode="json", exclude_none=True), sort_keys=False)


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario that ships here, by name, or any YAML file. Raises ConfigError."""
    given = Path(name_or_path)
    if given.suffix in {".yaml", ".yml"}:
        return load(given, Scenario)
    if len(given.parts) != 1 or given.name not in scenario_names():
        close = get_close_matches(given.name, scenario_names(), n=1)
        meant = f"did you mean {close[0]}? Else " if close else ""
        raise ConfigError(
            f"{name_or_path}: there is no such scenario; {meant}give a YAML file or one of: "
            f"{', '.join(scenario_names())}"
        )
    return load(SCENARIO_DIR / f"{given.name}.yaml", Scenario)
