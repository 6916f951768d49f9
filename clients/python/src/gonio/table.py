"""Tables of reflectance as NumPy arrays with named axes, units and errors."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidTable

Floats = npt.NDArray[np.float32]
ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
# Axes whose points are several angles at once, and which.
LISTS = {"incident": ANGLES[:2], "outgoing": ANGLES[2:], "pair": ANGLES}
# Coordinates of "outgoing" where it stands for cells: bounds in degrees and size in sr.
CELLS = ("theta_o_min", "theta_o_max", "phi_o_min", "phi_o_max", "solid_angle_o", "projected_solid_angle_o")


@dataclass(frozen=True)
class Table:
    """The BRDF f_r in 1/sr, no cosine inside, with the errors of each value.

    dims: names of the axes of the three arrays, for example ("theta_i", "phi_i", "theta_o", "phi_o", "channel").
        Directions that are every theta with every phi have an axis for each angle; others share one, "incident" or
        "outgoing"; a table of pairs has "pair" alone. "channel" follows, then "order" if orders were kept apart
        (0: their sum, k: the k-th alone).
    values, standard_error, bias: float32, one element a point. `error` combines the last two.
    coords: name -> values. Of an axis, along that axis; theta_i and phi_i of an axis "incident" along that one, and
        so on; of receiver cells, whose centres those are, also the bounds theta_o_min, theta_o_max, phi_o_min, phi_o_max
        and the sizes solid_angle_o, projected_solid_angle_o. Angles are in degrees: theta from the normal, phi from +x (columns) to +y (rows), both away from the
        surface.
    units: name -> unit, of coords and of "values".
    provenance: what made it: program, job_hash, surface_hash, seed, settings.
    """

    dims: tuple[str, ...]
    values: Floats
    standard_error: Floats
    bias: Floats
    coords: Mapping[str, npt.NDArray[Any]]
    units: Mapping[str, str]
    provenance: Mapping[str, str]

    @property
    def error(self) -> Floats:
        """sqrt(standard_error^2 + bias^2), in 1/sr."""
        return np.hypot(self.standard_error, self.bias)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.values.shape

    def sel(self, **wanted: float | str) -> Table:
        """The part of the table nearest to some coordinates; their axes go.

        Angles are found nearest to the one given (phi around the circle); a direction of a list by the angle between
        directions, so that all of its angles must be given. Channel and order must be there.

        >>> table.sel(theta_i=44, channel="y").dims
        ('phi_i', 'theta_o', 'phi_o')
        """
        table, left = self, dict(wanted)
        for axis, angles in LISTS.items():
            if axis in table.dims and any(name in left for name in angles):
                given = [_angle(left.pop(name, None), name, angles) for name in angles]
                table = table._take(axis, _nearest_direction([table.coords[name] for name in angles], given))
        for name, value in left.items():
            if name not in table.dims:
                raise KeyError(f"{name!r}: the axes are {', '.join(table.dims)}")
            table = table._take(name, _nearest(name, table.coords[name], value))
        return table

    def _take(self, axis: str, index: int) -> Table:
        number = self.dims.index(axis)
        gone = {axis, *LISTS.get(axis, ()), *(CELLS if axis == "outgoing" else ())}
        arrays = {name: getattr(self, name).take(index, number) for name in ("values", "standard_error", "bias")}
        return replace(self, dims=self.dims[:number] + self.dims[number + 1:], **arrays,
                       coords={name: values for name, values in self.coords.items() if name not in gone})


def make_table(stored: Sequence[Floats], channels: Sequence[str], n_orders: int, incident: npt.NDArray[np.float64],
               outgoing: npt.NDArray[np.float64], pairs: npt.NDArray[np.intp] | None, unit: str,
               provenance: Mapping[str, str], cells: npt.NDArray[np.float64] | None = None) -> Table:
    """A table from arrays as files hold them.

    stored: values, standard errors, biases, flat, in the order [channel][order][incident][outgoing] or
        [channel][order][pair]. incident, outgoing: rows of theta, phi in degrees. pairs: rows of an index of each.
        cells: rows of CELLS, one an outgoing direction.
    """
    coords: dict[str, npt.NDArray[Any]] = {}
    dims: tuple[str, ...] = ()
    extents: tuple[int, ...] = ()
    if pairs is None:
        for axis, angles, directions in (("incident", ANGLES[:2], incident), ("outgoing", ANGLES[2:], outgoing)):
            grid = _grid(directions) if axis == "incident" or cells is None else None
            dims += angles if grid else (axis,)
            extents += (len(grid[0]), len(grid[1])) if grid else (len(directions),)
            coords |= zip(angles, grid or directions.T)
    else:
        if pairs.size and (pairs.min() < 0 or (pairs.max(axis=0) >= (len(incident), len(outgoing))).any()):
            raise InvalidTable("pairs: an index is beyond the directions")
        dims, extents = ("pair",), (len(pairs),)
        coords |= zip(ANGLES, (*incident[pairs[:, 0]].T, *outgoing[pairs[:, 1]].T))
    if cells is not None:
        if cells.shape != (len(outgoing), len(CELLS)):
            raise InvalidTable(f"{len(cells)} cells: there are {len(outgoing)} outgoing directions")
        coords |= zip(CELLS, cells.T if pairs is None else cells[pairs[:, 1]].T)
    coords["channel"] = np.array(channels)
    shape = (len(channels), n_orders, *extents)
    arrays = []
    for array in stored:
        if array.size != np.prod(shape, dtype=np.int64):
            raise InvalidTable(f"{array.size} values: the axes take {' x '.join(map(str, shape))}")
        arrays.append(np.moveaxis(array.reshape(shape), (0, 1), (-2, -1)))
    dims += ("channel",)
    if n_orders > 1:
        dims += ("order",)
        coords["order"] = np.arange(n_orders)
    else:
        arrays = [array[..., 0] for array in arrays]
    units = {"values": unit, **{name: "deg" for name in ANGLES}}
    if cells is not None:
        units |= {name: "sr" if "solid" in name else "deg" for name in CELLS}
    return Table(dims, arrays[0], arrays[1], arrays[2], coords, units, provenance)


def _grid(directions: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
    """The thetas and phis whose product, theta slowest, the directions are; None if they are no product."""
    n = len(directions)
    n_phi = next((k for k in range(1, n) if directions[k, 0] != directions[0, 0]), n)
    if n == 0 or n % n_phi:
        return None
    grid = directions.reshape(-1, n_phi, 2)
    thetas, phis = grid[:, 0, 0], grid[0, :, 1]
    is_product = (grid[:, :, 0] == thetas[:, None]).all() and (grid[:, :, 1] == phis).all()
    return (thetas, phis) if is_product and len(set(thetas)) == len(thetas) else None


def _angle(value: float | str | None, name: str, needed: Sequence[str]) -> float:
    if value is None:
        raise KeyError(f"{name!r} is missing: these directions are a list, found by {', '.join(needed)}")
    return float(value)


def _nearest(axis: str, values: npt.NDArray[Any], wanted: float | str) -> int:
    if axis in ("channel", "order"):
        found = np.flatnonzero(values == wanted)
        if not len(found):
            raise KeyError(f"{axis} {wanted!r}: there are {', '.join(map(str, values))}")
        return int(found[0])
    difference = np.abs(values - float(wanted))
    if axis.startswith("phi"):
        difference = np.minimum(difference % 360, -difference % 360)
    return int(np.argmin(difference))


def _nearest_direction(angles: Sequence[npt.NDArray[np.float64]], wanted: Sequence[float]) -> int:
    """The row nearest to (theta, phi), or to (theta_i, phi_i, theta_o, phi_o): the squares of both distances add up."""
    distance = np.zeros(len(angles[0]))
    for k in range(0, len(angles), 2):
        row = _unit_vectors(angles[k], angles[k + 1])
        distance += ((row - _unit_vectors(wanted[k], wanted[k + 1])) ** 2).sum(axis=-1)
    return int(np.argmin(distance))


def _unit_vectors(theta: Any, phi: Any) -> npt.NDArray[np.float64]:
    theta, phi = np.radians(theta), np.radians(phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
