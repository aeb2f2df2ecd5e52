from __future__ import annotations

import numpy as np
import pytest

from config.scenario import load_scenario, scenario_names
from sim.models.textures import TexelPool, TextureStore, draw
from sim.world import World

KEYS = sorted({key for name in scenario_names() for key in World(load_scenario(name)).textures})


@pytest.mark.parametrize("kind", sorted({key.split("/")[0] for key in KEYS}))
def test_every_texture_in_use_is_an_image_and_the_same_for_the_same_seed(kind: str) -> None:
    key = next(key for key in KEYS if key.split("/")[0] == kind)
    image = draw(7, key)
    assert image.ndim == 3
    assert image.shape[2] == 3
    assert image.dtype == np.uint8
    again = draw.__wrapped__(7, key)
    assert again.tobytes() == image.tobytes()


def test_fine_textures_have_more_to_track_than_coarse_and_plain_ones() -> None:
    def detail(key: str) -> float:
        grey = draw(1, key).astype(np.float64).mean(axis=2)
        return float(np.abs(np.diff(grey, axis=1)).mean())

    assert detail("cardboard/1") > 2.0 * detail("plain/grey")
    assert detail("plain/grey") < 0.5


def test_another_seed_draws_something_else() -> None:
    assert draw(1, "cardboard/1").tobytes() != draw(2, "cardboard/1").tobytes()
    assert draw(1, "cardboard/1").tobytes() != draw(1, "cardboard/2").tobytes()


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(KeyError, match="velvet"):
        draw(1, "velvet")


def test_two_steps_halve_a_side_and_keep_the_mean() -> None:
    store = TextureStore(1)
    whole = store.sheet("cardboard/1", 0, 0, 1, 1).image
    half = store.sheet("cardboard/1", 2, 4, 1, 1).image
    height, width = draw(1, "cardboard/1").shape[:2]
    assert whole.shape == (height + 2, width + 2, 4)
    assert half.shape == (height // 4 + 2, width // 2 + 2, 4)
    assert half[1:-1, 1:-1].mean() == pytest.approx(whole[1:-1, 1:-1].mean(), abs=0.5)


def test_the_rim_goes_on_with_the_pattern_where_it_repeats_and_with_the_edge_where_it_ends() -> None:
    store = TextureStore(1)
    base = draw(1, "concrete")
    tiled = store.sheet("concrete", 0, 0, 2, 1).image
    assert np.array_equal(tiled[1:-1, 0, :3], base[:, -1])
    assert np.array_equal(tiled[1:-1, 1 + base.shape[1], :3], base[:, 0])
    single = store.sheet("concrete", 0, 0, 1, 1).image
    assert np.array_equal(single[1:-1, 0, :3], base[:, 0])


def test_texture_coordinates_lead_to_texels() -> None:
    sheet = TextureStore(1).sheet("cardboard/1", 0, 0, 1, 1)
    height, width = draw(1, "cardboard/1").shape[:2]
    # The middle of the first texel is half a texel from the corner, and lies at pixel 1 behind the rim.
    first = sheet.texture_to_pixel @ np.array([0.5 / width, 0.5 / height, 1.0])
    last = sheet.texture_to_pixel @ np.array([1.0 - 0.5 / width, 1.0 - 0.5 / height, 1.0])
    assert first[:2] == pytest.approx([1.0, 1.0])
    assert last[:2] == pytest.approx([width, height])


def test_the_pool_keeps_every_sheet_where_it_says() -> None:
    store = TextureStore(1)
    pool = TexelPool(store)
    names = [(f"cardboard/{n}", step, step) for n in range(6) for step in (0, 1, 3)]
    places = [pool.place(*name) for name in names]
    for name, (begin, width, height) in zip(names, places, strict=True):
        image = store.sheet(*name, 1, 1).image
        assert (height, width) == image.shape[:2]
        texels = pool.texels[begin : begin + width * height].view(np.uint8)
        assert np.array_equal(texels.reshape(image.shape), image)
    assert pool.place(*names[4]) == places[4]
