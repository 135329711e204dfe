"""What all formats with cells share: a limit on their number, and where their world ends."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array
from maneuver_automaton.collision import OccupancyMap
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import MapFile, Statement
from maneuver_automaton.formats.text_source import MAX_MAP_BYTES, read_bytes
from maneuver_automaton.groups import SE2
from maneuver_automaton.problem import Bounds

MAX_CELLS = 50_000_000
SMALLEST, LARGEST = 1e-6, 1e6  # of a cell [m]


def check_size(columns: int, rows: int, *, at: str) -> None:
    """Refuse a map without cells, and one with more than the memory of a laptop bears."""
    if not (columns > 0 and rows > 0):
        raise InvalidScenario(f"{at}: got {columns} x {rows} cells, need at least one")
    if columns * rows > MAX_CELLS:
        raise InvalidScenario(
            f"{at}: got {columns} x {rows} cells, need at most {MAX_CELLS // 1_000_000} million"
        )


def check_cell(size: float, *, at: str) -> None:
    """Refuse a size of cells [m] that no map has."""
    if not SMALLEST <= size <= LARGEST:
        raise InvalidScenario(f"{at}: got {size:g} m, need a size of {SMALLEST:g} to {LARGEST:g} m")


def bounds_around(cells: OccupancyMap) -> Bounds:
    """The upright rectangle around a map: a planner has no business where nothing is known."""
    width, height = cells.extent
    corners = SE2(cells.origin).act(
        np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    )
    (left, low), (right, high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return Bounds(x=(left, right), y=(low, high))


def world_of(cells: OccupancyMap, path: Path, kind: str, *maps: MapFile) -> Statement:
    """A world with one map, and bounds around it; the rest of the problem is left to others."""
    bounds = bounds_around(cells)
    return Statement(format=kind, name=path.stem, obstacles=(cells,), bounds=bounds, maps=maps)


def drawn_headings(case: int) -> Array:
    """Headings (2,) of start and goal [rad], where a file states none: the same at every call."""
    return np.random.default_rng(case).uniform(-np.pi, np.pi, 2)


OTHER_IMAGES = (".png", ".bmp")
_SPACE = rb"(?:\s|#[^\r\n]*[\r\n])"
_HEADER = re.compile(
    rb"P([25])" + (_SPACE + rb"+(\d{1,9})") * 3 + rb"(?:#[^\r\n]*)?(?:\r\n|\s)", re.DOTALL
)


@dataclass(frozen=True, slots=True, eq=False)
class GreyImage:
    """Shades, the first row at the top: 0 is black, 1 is white."""

    shade: Array  # (rows, columns), in [0, 1]
    opaque: NDArray[np.bool_]  # (rows, columns)


def read_grey_image(path: Path) -> GreyImage:
    """The shades of a PGM (binary or text, 8 or 16 bit), PNG or BMP.

    Colours count as the mean of red, green and blue.
    """
    if path.suffix.lower() in OTHER_IMAGES:
        return _through_pillow(path)
    content = read_bytes(path, most=MAX_MAP_BYTES, what="an image")
    header = _HEADER.match(content)
    if header is None:
        raise InvalidScenario(
            f"{path}: is no image that this version reads, need PGM that begins with P2 or P5, "
            "width, height and greatest value, or PNG or BMP with that ending"
        )
    kind, columns, rows, greatest = (int(word) for word in header.groups())
    check_size(columns, rows, at=str(path))
    if not 0 < greatest < 65536:
        raise InvalidScenario(f"{path}: got a greatest value of {greatest}, need 1 to 65535")
    body = content[header.end() :]
    read = _binary if kind == 5 else _plain
    values = read(path, body, columns * rows, greatest)
    if values.max() > greatest:
        raise InvalidScenario(
            f"{path}: got the value {int(values.max())}, need at most {greatest}, the greatest "
            "that its header states"
        )
    shade = (values / greatest).reshape(rows, columns)
    return GreyImage(shade, np.ones((rows, columns), dtype=np.bool_))


def _binary(path: Path, body: bytes, n: int, greatest: int) -> NDArray[np.uint16]:
    size = 1 if greatest < 256 else 2
    if len(body) < n * size:
        raise InvalidScenario(
            f"{path}: got {len(body)} bytes of pixels, need {n * size}: the file is cut off"
        )
    if len(body) > n * size and body[n * size :].strip():
        raise InvalidScenario(
            f"{path}: got {len(body)} bytes of pixels, need {n * size}: the rest belongs to nothing"
        )
    values = np.frombuffer(body[: n * size], dtype=np.uint8 if size == 1 else ">u2")
    return values.astype(np.uint16)


def _plain(path: Path, body: bytes, n: int, greatest: int) -> NDArray[np.uint16]:
    words = re.sub(rb"#[^\r\n]*", b"", body).split()
    if len(words) != n:
        raise InvalidScenario(f"{path}: got {len(words)} pixels, need {n}")
    try:
        values = np.array(words).astype(np.int64)
    except (ValueError, OverflowError) as error:
        said = next(word for word in words if not re.fullmatch(rb"\d{1,9}", word))
        shown = said[:20].decode("ascii", errors="replace")
        raise InvalidScenario(f"{path}: got {shown!r} as a pixel, need a whole number") from error
    if values.min() < 0:
        raise InvalidScenario(f"{path}: got {values.min()} as a pixel, need a whole number")
    return np.minimum(values, 65535).astype(np.uint16)


def _through_pillow(path: Path) -> GreyImage:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of large images, which we refuse
            with Image.open(path, formats=("PNG", "BMP")) as image:
                check_size(*image.size, at=str(path))
                deep = image.mode.startswith("I")
                array = np.asarray(image if deep else image.convert("RGBA"))
    except FileNotFoundError as error:
        raise InvalidScenario(f"{path}: no such file") from error
    except Image.DecompressionBombError as error:
        raise InvalidScenario(f"{path}: has too many pixels") from error
    except InvalidScenario:
        raise
    except (OSError, ValueError, SyntaxError, EOFError, IndexError) as error:
        said = " ".join(str(error).replace(repr(str(path)), "").split())
        raise InvalidScenario(f"{path}: cannot be read as an image: {said}") from error
    if deep:  # 16 bit of grey
        return GreyImage(array / 65535.0, np.ones(array.shape, dtype=np.bool_))
    return GreyImage(array[..., :3].mean(axis=-1) / 255.0, array[..., 3] == 255)
