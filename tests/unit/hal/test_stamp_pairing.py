"""Colour and depth that arrive one after the other, in pairs."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hal.cameras.stamp_pairing import StampPairing
from hal.cameras.tum_index import associate

GAP = 20
STAMPS = st.lists(st.integers(0, 400), unique=True, max_size=20).map(sorted)


def paired(colour: list[int], depth: list[int]) -> tuple[list[tuple[int, int]], StampPairing[None]]:
    """As they would arrive: in the order of their times."""
    pairing: StampPairing[None] = StampPairing(GAP)
    found = []
    for stamp, stream in sorted([(one, 0) for one in colour] + [(one, 1) for one in depth]):
        (pairing.colour, pairing.depth)[stream].add(stamp, None)
        found += list(pairing.pairs(ended=False))
    found += list(pairing.pairs(ended=True))
    return [(a.stamp_ns, b.stamp_ns) for a, b in found], pairing


def test_the_nearest_depth_is_taken() -> None:
    assert paired([100, 200], [95, 110, 190, 204])[0] == [(100, 95), (200, 204)]


def test_too_far_apart_is_no_pair() -> None:
    pairs, pairing = paired([100, 200], [121, 200])
    assert pairs == [(200, 200)]
    assert (pairing.colour.unpaired, pairing.depth.unpaired) == (1, 1)


def test_out_of_order_stamps_are_dropped_and_counted() -> None:
    pairing: StampPairing[str] = StampPairing(GAP)
    for stamp in (10, 10, 5, 30):
        pairing.colour.add(stamp, "")
    assert [one.number for one in pairing.colour.waiting] == [0, 3]
    assert pairing.colour.out_of_order == 2


def test_a_pair_is_given_as_soon_as_nothing_that_comes_can_change_it() -> None:
    pairing: StampPairing[str] = StampPairing(GAP)
    pairing.depth.add(95, "early")
    pairing.colour.add(100, "picture")
    pairing.depth.add(160, "late")
    assert list(pairing.pairs(ended=False)) == []
    pairing.colour.add(160, "next")
    ((colour, depth),) = pairing.pairs(ended=False)
    assert (colour.item, depth.item) == ("picture", "early")


def test_one_lost_image_does_not_shift_all_that_follow() -> None:
    """Where frames come faster than max_gap, the next one's depth is near enough too."""
    stamps = list(range(0, 400, 11))
    assert paired(stamps, stamps[1:])[0] == [(one, one) for one in stamps[1:]]


def test_surplus_colour_images_are_paired_by_time() -> None:
    assert paired(list(range(0, 400, 11)), list(range(11, 400, 22)))[0] == [
        (one, one) for one in range(11, 400, 22)
    ]


def test_images_do_not_pile_up_after_the_other_stream_has_ended() -> None:
    for ended in ("colour", "depth"):
        pairing: StampPairing[None] = StampPairing(GAP)
        stream = pairing.depth if ended == "colour" else pairing.colour
        for number in range(300):
            stream.add(number * 33_333_333, None)
            assert list(pairing.pairs(ended=False)) == []
            assert len(stream.waiting) <= 62
        assert stream.unpaired + len(stream.waiting) == 300


def test_a_time_that_is_far_off_does_not_make_the_other_stream_pile_up() -> None:
    pairing: StampPairing[None] = StampPairing(GAP)
    pairing.colour.add(10**18, None)
    for number in range(300):
        pairing.depth.add(number * 33_333_333, None)
        assert list(pairing.pairs(ended=False)) == []
        assert len(pairing.depth.waiting) <= 2


@given(STAMPS, STAMPS)
def test_images_are_paired_as_those_of_a_folder(colour: list[int], depth: list[int]) -> None:
    folder = [(colour[i], depth[j]) for i, j in associate(colour, depth, GAP)]
    assert paired(colour, depth)[0] == folder


@given(STAMPS, STAMPS)
def test_pairs_are_near_grow_and_nothing_is_lost(colour: list[int], depth: list[int]) -> None:
    pairs, pairing = paired(colour, depth)
    assert all(abs(a - b) <= GAP for a, b in pairs)
    for stream in (0, 1):
        stamps = [pair[stream] for pair in pairs]
        assert stamps == sorted(set(stamps))
    assert len(pairs) + pairing.colour.unpaired == len(colour)
    assert len(pairs) + pairing.depth.unpaired == len(depth)
    assert not pairing.colour.waiting
    assert not pairing.depth.waiting
    # Who stays alone could only have what would go back in time.
    for alone in set(colour) - {a for a, _ in pairs}:
        before = max((b for a, b in pairs if a < alone), default=-1)
        after = min((b for a, b in pairs if a > alone), default=401)
        assert not [b for b in depth if before < b < after and abs(alone - b) <= GAP]
