"""Reads tables as gonio writes them: JSON and CSV."""
from __future__ import annotations

import io
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidTable
from .table import Table, make_table

VERSION = 1
CELL_COLUMNS = ["theta_o_min_deg", "theta_o_max_deg", "phi_o_min_deg", "phi_o_max_deg", "solid_angle_o_sr",
                "projected_solid_angle_o_sr"]


def read_table(path: str | os.PathLike[str]) -> Table:
    """The table in a file, JSON or CSV by content. Raises InvalidTable, also for a file that cannot be read."""
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InvalidTable(f"{path}: {error.strerror}") from error
    try:
        return parse_table(content)
    except InvalidTable as error:
        raise InvalidTable(f"{path}: {error}") from error


def parse_table(content: bytes) -> Table:
    """The table in the bytes of a file. Raises InvalidTable."""
    try:
        return (_parse_json if content.lstrip()[:1] == b"{" else _parse_csv)(content)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise InvalidTable(f"no gonio table: {error}") from error


def _check_version(version: Any) -> None:
    if version != VERSION:
        raise InvalidTable(f"version {version}: this package reads version {VERSION}")


def _parse_json(content: bytes) -> Table:
    root = json.loads(content)
    if root["format"] != "gonio-table":
        raise InvalidTable(f"format {root['format']!r}: must be gonio-table")
    _check_version(root["version"])
    axes = {axis["name"]: axis["values"] for axis in root["axes"]}
    pairs = None if root.get("pairs") is None else np.array(root["pairs"], dtype=np.intp).reshape(-1, 2)
    stored = [np.array(root[name], dtype=np.float32) for name in ("values", "standard_error", "bias")]
    cells = next((axis["cells"] for axis in root["axes"] if axis["name"] == "outgoing" and "cells" in axis), None)
    bounds = None if cells is None else np.column_stack(
        [np.reshape(cells["values"], (-1, 4)), cells["solid_angle_sr"], cells["projected_solid_angle_sr"]])
    return make_table(stored, axes["channel"], len(axes["order"]), _directions(axes["incident"]),
                      _directions(axes["outgoing"]), pairs, root["quantity"]["unit"], dict(root["provenance"]), bounds)


def _directions(values: list[list[float]]) -> npt.NDArray[np.float64]:
    return np.array(values, dtype=np.float64).reshape(-1, 2)


def _parse_csv(content: bytes) -> Table:
    lines = content.decode().splitlines()
    if not lines or not lines[0].startswith("# gonio table, version "):
        raise InvalidTable("the first line must be '# gonio table, version 1'")
    _check_version(int(lines[0].rsplit(" ", 1)[1]))
    n_comments = next(k for k, line in enumerate([*lines, ""]) if not line.startswith("#"))
    columns = lines[n_comments].split(",") if n_comments < len(lines) else []
    directions = 4 + len(CELL_COLUMNS) if columns[4:4 + len(CELL_COLUMNS)] == CELL_COLUMNS else 4
    has_orders = columns[directions:directions + 1] == ["order"]
    first = directions + has_orders
    channels = [name.removeprefix("f_") for name in columns[first::3]]
    expected = [f"{kind}_{name}" for name in channels for kind in ("f", "se", "bias")]
    if columns[:4] != ["theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg"] or not channels \
            or columns[first:] != expected:
        raise InvalidTable(f"line {n_comments + 1}: no header of a table")
    data = np.loadtxt(io.StringIO("\n".join(lines[n_comments + 1:])), delimiter=",", ndmin=2)
    if data.shape[1:] != (len(columns),):
        raise InvalidTable(f"the rows have {data.shape[1:]} values: the header has {len(columns)}")
    n_orders = int(data[:, directions].max()) + 1 if has_orders else 1
    # [row][channel][value, se, bias] of rows that run through the orders of each pair
    values = data[:, first:].reshape(-1, n_orders, len(channels), 3)
    stored = [values[..., k].transpose(2, 1, 0).astype(np.float32).ravel() for k in range(3)]
    incident, i = _distinct(data[::n_orders, 0:2])
    outgoing, o = _distinct(data[::n_orders, 2:directions])
    cells = outgoing[:, 2:] if directions > 4 else None
    pairs: npt.NDArray[np.intp] | None = np.stack([i, o], axis=1)
    if np.array_equal(i * len(outgoing) + o, np.arange(len(incident) * len(outgoing))):
        pairs = None
    return make_table(stored, channels, n_orders, incident, outgoing[:, :2], pairs, "1/sr",
                      _provenance(lines[:n_comments]), cells)


def _distinct(rows: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.intp]]:
    """Distinct rows in the order in which they come, and the index of each row among them."""
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[inverse.reshape(-1)]


def _provenance(comments: list[str]) -> dict[str, str]:
    if "# provenance" not in comments:
        return {}
    entries = [re.fullmatch(r"# ((?:\\.|[^\\:])+): (.*)", line) for line in
               comments[comments.index("# provenance") + 1:]]
    return {_unescape(entry[1]): _unescape(entry[2]) for entry in entries if entry}


def _unescape(text: str) -> str:
    return re.sub(r"\\(.)", lambda match: {"n": "\n", "r": "\r"}.get(match[1], match[1]), text)
