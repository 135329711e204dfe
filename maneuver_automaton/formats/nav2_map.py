"""Occupancy maps of Nav2 and ROS: a YAML file beside an image.

`origin` is the pose of the lower left corner of the image, `resolution` the size of a pixel. The
occupancy of a pixel is ``1 - shade``, or its shade if `negate`; in the mode raw, its value (0 to
100) in percent. At `occupied_thresh` and above a cell is blocked, at `free_thresh` and below it is
free. Between, and where an image is transparent or a raw value above 100, nothing is known.

For obstacles the mode scale counts as trinary: shades between the thresholds are not known.
"""

from __future__ import annotations

import contextlib
import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from maneuver_automaton._arrays import Array, IntArray
from maneuver_automaton._files import write_bytes_atomically, write_text_atomically
from maneuver_automaton._lazy import shapely
from maneuver_automaton._limits import MOST_HEADING
from maneuver_automaton.collision import OccupancyMap, Polygon
from maneuver_automaton.collision.outline import united
from maneuver_automaton.collision.surroundings import runs_of
from maneuver_automaton.errors import InvalidScenario
from maneuver_automaton.formats.statement import (
    MapFile,
    Statement,
    Unknown,
    check_cell,
    check_size,
    world_of,
)
from maneuver_automaton.formats.text_source import MAX_MAP_BYTES, read_bytes, read_text
from maneuver_automaton.formats.yaml_source import Document, parse, shown
from maneuver_automaton.groups import SE2

MODES = ("trinary", "scale", "raw")
YES_OR_NO = {"yes": True, "on": True, "no": False, "off": False}  # words of YAML 1.1
FARTHEST_CELL = 1e12  # cells between the map and the origin; more, and their corners coincide
REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_A_KEY = re.compile(rf"(?m)^[\s{{\"']*({'|'.join(REQUIRED)})[\"']?\s*:")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    image: str
    resolution: float  # [m]
    origin: tuple[float, ...]  # [m, m, rad]
    negate: bool
    occupied: float
    free: float
    mode: str  # one of MODES


def load_nav2_map(path: Path, *, unknown: Unknown = "blocked") -> OccupancyMap:
    """The map of a YAML file; `unknown` says how to read cells of which it knows nothing."""
    return map_of_document(_document(path), path, unknown=unknown)


def map_of_document(
    document: Document, path: Path, *, unknown: Unknown = "blocked"
) -> OccupancyMap:
    """The map of a YAML file that was read before; see `load_nav2_map`."""
    header = _header(document)
    occupancy, known = _occupancy(_image(document, path, header), header)
    cells = (occupancy >= header.occupied) & known  # the first row at the top
    if unknown == "blocked":
        cells |= (occupancy > header.free) | ~known
    return OccupancyMap(
        cells[::-1], resolution=header.resolution, origin=header.origin, name=path.name
    )


class Mask(NamedTuple):
    """Values that a map states of its cells, as map_server gives them to a costmap filter."""

    values: IntArray  # (rows, columns), the first row the lowest: 0 to 100, -1 if unknown
    resolution: float  # [m]
    origin: tuple[float, ...]  # [m, m, rad] of the lower left corner

    def regions(self) -> list[tuple[int, Polygon]]:
        """Connected cells of one value above 0, each with the polygon that is their union."""
        found = []
        for value in np.unique(self.values[self.values > 0]).tolist():
            cells = OccupancyMap(self.values == value, resolution=1.0)
            for part in shapely.get_parts(united(runs_of(cells))):
                rings = [part.exterior, *part.interiors]  # in cells: whole numbers, exactly
                corners = [
                    SE2(np.array(self.origin)).act(
                        self.resolution * shapely.get_coordinates(shapely.simplify(ring, 0.0))[:-1]
                    )
                    for ring in rings
                ]
                found.append((int(value), Polygon(corners[0], corners[1:])))
        return found


def load_nav2_mask(path: Path) -> Mask:
    """The mask of a costmap filter, such as limits of speed."""
    document = _document(path)
    header = _header(document)
    image = _image(document, path, header)
    occupancy, known = _occupancy(image, header)
    if header.mode == "raw":
        share = occupancy
    else:
        between = max(header.occupied - header.free, np.finfo(np.float64).tiny)
        share = np.clip((occupancy - header.free) / between, 0.0, 1.0)
        share = np.where(occupancy >= header.occupied, 1.0, share)
        if header.mode == "trinary":
            known = known & ((share == 0.0) | (share == 1.0))
    values = np.where(known, np.rint(100.0 * share), -1.0).astype(np.int64)
    return Mask(values[::-1], header.resolution, header.origin)


def read_nav2_map(path: Path, document: Document) -> tuple[Statement, ...]:
    """A world with one map, and bounds around it; the rest is left to others."""
    cells = map_of_document(document, path)
    return (world_of(cells, path, "Nav2 map", MapFile(map=cells, path=path)),)


def save_nav2_map(cells: OccupancyMap, path: Path) -> None:
    """Write a map as YAML and a .pgm beside it, which read back to the last bit."""
    rows, columns = cells.blocked.shape
    image = path.with_suffix(".pgm")
    pixels = np.where(cells.blocked[::-1], 0, 254).astype(np.uint8)
    write_bytes_atomically(image, f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes())
    origin = ", ".join(repr(value) for value in cells.origin.tolist())
    name = image.name.replace("\\", "\\\\").replace('"', '\\"')
    write_text_atomically(
        path,
        f'image: "{name}"\nmode: trinary\nresolution: {float(cells.resolution)!r}\n'
        f"origin: [{origin}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
    )


def _document(path: Path) -> Document:
    text = read_text(path, what="a map")
    if text.strip() and not _A_KEY.search(text):  # what another file holds is not for a message
        raise InvalidScenario(f"{path}: is no map, need YAML with the keys {', '.join(REQUIRED)}")
    return parse(text, name=str(path), what="a map")


def _image(document: Document, path: Path, header: _Header) -> GreyImage:
    image = Path(header.image)
    with contextlib.suppress(RuntimeError):  # there is no home
        image = image.expanduser()
    try:
        return read_grey_image(path.parent / image)
    except InvalidScenario as error:
        raise document.error(("image",), str(error)) from error


def _header(document: Document) -> _Header:
    value = document.value
    if not isinstance(value, dict):
        raise document.error((), f"got {shown(value)}, need the keys {', '.join(REQUIRED)}")
    for key in REQUIRED:
        if key not in value:
            raise document.error(
                (), f"the key {key!r} is missing: a map needs {', '.join(REQUIRED)}"
            )
    image, origin, mode = value["image"], value["origin"], value.get("mode", "trinary")
    if not isinstance(image, str) or not image.strip() or "\0" in image:
        raise document.error(("image",), f"got {shown(image)}, need the name of an image file")
    if not (isinstance(origin, list) and len(origin) == 3):
        raise document.error(("origin",), f"got {shown(origin)}, need [x, y, yaw]")
    if not isinstance(mode, str) or mode.lower() not in MODES:
        raise document.error(("mode",), f"got {shown(mode)}, need one of {', '.join(MODES)}")
    resolution = _number(document, ("resolution",))
    check_cell(resolution, at=f"{document.name}:{document.line_of(('resolution',))}: resolution")
    occupied, free = (
        _number(document, (key,), most=1.0) for key in ("occupied_thresh", "free_thresh")
    )
    if free > occupied:
        raise document.error(
            ("free_thresh",), f"got {free:g}, need at most occupied_thresh, {occupied:g}"
        )
    places = tuple(_number(document, ("origin", k)) for k in range(3))
    for k, place in enumerate(places):
        most = FARTHEST_CELL * resolution if k < 2 else MOST_HEADING
        if abs(place) > most:
            raise document.error(("origin", k), f"got {place:g}, need at most {most:g} in size")
    negate = value["negate"]
    if isinstance(negate, str):
        negate = YES_OR_NO.get(negate.lower(), negate)
    if negate not in (0, 1) or isinstance(negate, float):
        raise document.error(("negate",), f"got {shown(negate)}, need 0 or 1")
    return _Header(
        image=image,
        resolution=resolution,
        origin=places,
        negate=bool(negate),
        occupied=occupied,
        free=free,
        mode=mode.lower(),
    )


def _number(document: Document, where: tuple[str | int, ...], most: float = math.inf) -> float:
    value: Any = document.value
    for step in where:
        value = value[step]
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not good or (most < math.inf and not 0.0 <= value <= most):
        need = "a finite number" if most == math.inf else f"a number from 0 to {most:g}"
        raise document.error(where, f"got {shown(value)}, need {need}")
    return float(value)


def _occupancy(image: GreyImage, header: _Header) -> tuple[Array, NDArray[np.bool_]]:
    """Shares of occupancy, the first row at the top, and whether they are known."""
    if header.mode == "raw":
        shares = np.round(image.shade * 255.0) / 100.0
        return shares, shares <= 1.0
    return image.shade if header.negate else 1.0 - image.shade, image.opaque


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
    """The shades of a PGM (8 or 16 bit), PNG or BMP; the mean of red, green and blue."""
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
    return np.frombuffer(body[: n * size], dtype=np.uint8 if size == 1 else ">u2").astype(np.uint16)


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
