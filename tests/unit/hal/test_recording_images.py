"""Images of a recording: whole and of the right kind, or refused with a reason."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from hal.cameras.image_file import ImageError, read_colour, read_depth

WIDTH, HEIGHT = 64, 48


@pytest.fixture
def colour(tmp_path: Path) -> Path:
    path = tmp_path / "colour.png"
    image = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    assert cv2.imwrite(str(path), image)
    return path


@pytest.fixture
def depth(tmp_path: Path) -> Path:
    path = tmp_path / "depth.png"
    image = np.random.default_rng(2).integers(0, 65536, (HEIGHT, WIDTH)).astype(np.uint16)
    assert cv2.imwrite(str(path), image)
    return path


def test_colour_comes_as_stored_in_bgr(tmp_path: Path) -> None:
    path = tmp_path / "blue.png"
    assert cv2.imwrite(str(path), np.full((HEIGHT, WIDTH, 3), (255, 20, 3), np.uint8))
    image = read_colour(path, WIDTH, HEIGHT)
    assert image.dtype == np.uint8
    assert np.all(image == (255, 20, 3))


def test_depth_comes_as_stored_in_16_bits(depth: Path) -> None:
    expected = np.random.default_rng(2).integers(0, 65536, (HEIGHT, WIDTH)).astype(np.uint16)
    image = read_depth(depth, WIDTH, HEIGHT)
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, expected)


def test_a_jpeg_colour_image_is_read(tmp_path: Path) -> None:
    path = tmp_path / "colour.jpg"
    assert cv2.imwrite(str(path), np.full((HEIGHT, WIDTH, 3), 128, np.uint8))
    assert read_colour(path, WIDTH, HEIGHT).shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9, 0.999])
def test_a_png_that_is_cut_off_anywhere_is_refused_without_a_word_on_stderr(
    colour: Path, kept: float, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = colour.read_bytes()
    colour.write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(ImageError, match="is cut off: its end is missing"):
        read_colour(colour, WIDTH, HEIGHT)
    assert capfd.readouterr().err == ""


def test_a_png_without_its_last_byte_is_refused(depth: Path) -> None:
    depth.write_bytes(depth.read_bytes()[:-1])
    with pytest.raises(ImageError, match="is cut off"):
        read_depth(depth, WIDTH, HEIGHT)


def test_a_flipped_bit_in_the_pixels_is_refused(colour: Path) -> None:
    data = bytearray(colour.read_bytes())
    data[len(data) // 2] ^= 0x10
    colour.write_bytes(bytes(data))
    with pytest.raises(ImageError, match="a checksum does not match"):
        read_colour(colour, WIDTH, HEIGHT)


def test_pixels_that_do_not_decode_although_every_checksum_is_right_are_refused(tmp_path: Path) -> None:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0))
    path = tmp_path / "broken.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", b"nonsense") + chunk(b"IEND", b""))
    with pytest.raises(ImageError, match="pixels cannot be decoded"):
        read_colour(path, WIDTH, HEIGHT)


def test_a_jpeg_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "colour.jpg"
    assert cv2.imwrite(str(path), np.full((HEIGHT, WIDTH, 3), 128, np.uint8))
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ImageError, match="is cut off"):
        read_colour(path, WIDTH, HEIGHT)


def test_a_missing_an_empty_and_a_foreign_file_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "colour.png"
    with pytest.raises(ImageError, match=r"cannot be read .*No such file"):
        read_colour(path, WIDTH, HEIGHT)
    path.write_bytes(b"")
    with pytest.raises(ImageError, match="is empty"):
        read_colour(path, WIDTH, HEIGHT)
    path.write_bytes(b"GIF89a")
    with pytest.raises(ImageError, match="neither a PNG nor a JPEG"):
        read_colour(path, WIDTH, HEIGHT)


@pytest.mark.parametrize("path", [Path("/dev/null"), Path("/")])
def test_a_device_a_pipe_and_a_folder_are_never_read(path: Path) -> None:
    with pytest.raises(ImageError, match="is not a regular file"):
        read_colour(path, WIDTH, HEIGHT)


def test_a_wrong_size_is_told_with_both_sizes(colour: Path) -> None:
    with pytest.raises(ImageError, match=r"is 64x48, its calibration says 640x480"):
        read_colour(colour, 640, 480)


@pytest.mark.parametrize(
    ("image", "told"),
    [
        (np.zeros((HEIGHT, WIDTH), np.uint8), "is 8-bit with 1 channel,"),
        (np.zeros((HEIGHT, WIDTH, 3), np.uint8), "is 8-bit with 3 channels,"),
        (np.zeros((HEIGHT, WIDTH, 3), np.uint16), "is 16-bit with 3 channels,"),
    ],
)
def test_depth_of_the_wrong_type_is_refused(tmp_path: Path, image: np.ndarray, told: str) -> None:
    path = tmp_path / "depth.png"
    assert cv2.imwrite(str(path), image)
    with pytest.raises(ImageError, match=f"{told} a depth image has 16 bits and 1 channel"):
        read_depth(path, WIDTH, HEIGHT)


@pytest.mark.parametrize(
    "image",
    [
        np.full((HEIGHT, WIDTH), 90, np.uint8),
        np.full((HEIGHT, WIDTH, 4), (90, 90, 90, 0), np.uint8),
        np.full((HEIGHT, WIDTH, 3), 90 * 257, np.uint16),
        np.full((HEIGHT, WIDTH, 4), (90 * 257, 90 * 257, 90 * 257, 7), np.uint16),
    ],
    ids=["grey", "alpha", "16 bits", "16 bits and alpha"],
)
def test_grey_alpha_and_16_bits_become_colour_of_8_bits(tmp_path: Path, image: np.ndarray) -> None:
    """As renderers and some cameras write it; what is transparent is seen all the same."""
    path = tmp_path / "colour.png"
    assert cv2.imwrite(str(path), image)
    found = read_colour(path, WIDTH, HEIGHT)
    assert found.dtype == np.uint8
    assert found.shape == (HEIGHT, WIDTH, 3)
    assert np.all(found == 90)


def test_alpha_does_not_change_the_order_of_the_colours(tmp_path: Path) -> None:
    path = tmp_path / "blue.png"
    assert cv2.imwrite(str(path), np.full((HEIGHT, WIDTH, 4), (255, 20, 3, 128), np.uint8))
    assert np.all(read_colour(path, WIDTH, HEIGHT) == (255, 20, 3))


def test_depth_in_the_place_of_colour_is_refused(depth: Path) -> None:
    with pytest.raises(ImageError, match=r"^is 16-bit with 1 channel, a colour image has .* 8 bits of grey$"):
        read_colour(depth, WIDTH, HEIGHT)
