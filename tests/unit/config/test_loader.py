from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from config.loader import CONFIG_DIR, ConfigError, Section, load, resolve


class Inner(Section):
    speed_mps: float = Field(default=1.0, gt=0)


class One(Section):
    kind: Literal["one"]


class Two(Section):
    kind: Literal["two"]


class Outer(Section):
    count: int
    inner: Inner = Inner()
    many: Annotated[tuple[int, ...], Field(strict=False)] = ()
    one: Annotated[One | Two, Field(discriminator="kind")] = One(kind="one")


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return path


def refusal(tmp_path: Path, text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, text), Outer)
    message = str(caught.value)
    assert "\n" not in message
    assert str(tmp_path / "robot.yaml") in message
    return message


def test_a_good_file_is_read(tmp_path: Path) -> None:
    config = load(written(tmp_path, "count: 3\ninner: {speed_mps: 2}\n"), Outer)
    assert config == Outer(count=3, inner=Inner(speed_mps=2.0))


def test_merged_yaml_key_may_be_overridden(tmp_path: Path) -> None:
    config = load(written(tmp_path, "count: 3\ninner: {<<: {speed_mps: 1}, speed_mps: 2}\n"), Outer)
    assert config.inner.speed_mps == 2.0


def test_every_mistake_is_named_with_its_key(tmp_path: Path) -> None:
    message = refusal(tmp_path, "inner: {speed_mps: -1, sped_mps: 2}\n")
    assert "count: missing key" in message
    assert "inner.speed_mps: Input should be greater than 0, found -1" in message
    assert "inner.sped_mps: unknown key" in message


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("count: true", "found True"),
        ("count: '3'", "found '3'"),
        ("count: 1.5", "found 1.5"),
        ("count: 3\ninner: {speed_mps: .nan}", "finite"),
        ("count: 3\ncount: 4", "given twice"),
        (
            "count: [3",
            "not valid YAML: line 1, column 10: expected ',' or ']', but got '<stream end>' (while",
        ),
        (
            "a: 1\n\tb: 2",
            "not valid YAML: line 2, column 1: found character '\\t' that cannot start any token",
        ),
        ("a: 1\n\tb: 2", "; indent with spaces, not with tabs"),
        ("count: 2020-13-45", "line 1, column 8: '2020-13-45' is no timestamp; put text in quotes"),
        ("count: " + "9" * 5000, "is no int"),
        ("count: !!timestamp soon", "'soon' is no timestamp"),
        ("count: !!int ''", "'' is no int"),
        ("count: !!set [a]", "expected keys and values"),
        ("? [1, 2]\n: 3", "line 1, column 3: a key must be a word, not a list or other keys"),
        ("? {a: 1}\n: 3", "a key must be a word"),
        ("inner: " + "[" * 3000 + "]" * 3000, "nested too deeply"),
        ("inner: &a {<<: {speed_mps: 1}, speed_mps: 2, speed_mps: 3}", "given twice"),
        ("inner: {<<: 3}", "expected a mapping or list of mappings for merging"),
        ("inner: 3", "inner: Input should be keys and values, found 3"),
        ("count: 3\nmany: 3", "many: Input should be a list, found 3"),
        ("count: 3\none: {b: 1}", "one: its key kind is missing"),
        ("count: 3e0", "found '3e0', which is text: write 3"),
        ("count: 3\ninner: {speed_mps: '1.5'}", "found '1.5', which is text: write 1.5"),
        ("- 3", "must hold keys and values, found list"),
        ("", "is empty; it must hold keys and values"),
        ("inner: {" + ", ".join(f"k{n}: 1" for n in range(12)) + "}", "; and 5 more mistakes"),
        ("name: a\nroom: {}\nbodies: []\ncount: 3", "another kind of file: name, room, bodies mean nothing"),
        ("count: 3\ninner: {}\nmany: []\nname: a\nroom: {}\nbodies: []", "name: unknown key"),
        ("count: 3\nname: a\nroom: {}", "name: unknown key"),
    ],
)
def test_wrong_content_is_refused_in_one_line(tmp_path: Path, text: str, reason: str) -> None:
    assert reason in refusal(tmp_path, text)


def test_number_outside_its_bounds_is_told_with_its_unit(tmp_path: Path) -> None:
    assert "speed_mps: Input should be greater than 0, found -2 m/s" in refusal(
        tmp_path, "count: 1\ninner: {speed_mps: -2}"
    )


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot be read \(No such file"):
        load(tmp_path / "none.yaml", Outer)


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "image.yaml"
    path.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ConfigError, match="not UTF-8"):
        load(path, Outer)


def test_a_named_file_is_found_beside_the_yaml_first_then_among_those_that_ship(tmp_path: Path) -> None:
    main = tmp_path / "main.yaml"
    (tmp_path / "near.yaml").touch()
    assert resolve("near.yaml", main) == tmp_path / "near.yaml"
    assert resolve("sim.yaml", main) == CONFIG_DIR / "sim.yaml"
    assert resolve("none.yaml", main) == tmp_path / "none.yaml", "what is nowhere is missed beside the YAML"
    assert resolve("/abs/a.yaml", main) == Path("/abs/a.yaml")
    assert resolve("a" * 5000, main) == tmp_path / ("a" * 5000), "no file can be called so"
