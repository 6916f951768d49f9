"""Files of large arrays: BTFs, light fields and maps, as `gonio run` and the service write them."""
from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidTable

LONGEST_HEAD = 64 << 20


@dataclass(frozen=True)
class Arrays:
    """What a file of arrays holds.

    head: what the numbers are, axes, units, errors in words, provenance. arrays: by name, mapped from the file and read
    where they are looked at; numpy.save(path, a["images"]) makes a .npy of one.
    """

    head: dict[str, Any]
    arrays: dict[str, npt.NDArray[Any]]

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self.arrays[name]

    def images(self, view: int) -> npt.NDArray[np.float32]:
        """Of a BTF or light field in either form: [light, channel, row, column] of one view, in 1/sr, row 0 at low y."""
        if "images" in self.arrays:
            return np.asarray(self.arrays["images"][view], np.float32)
        radiance, maps = self.arrays["facet_radiance"], self.arrays["view_maps"][view]
        values = np.asarray(radiance[:, :, maps], np.float32).mean(axis=2)
        return np.ascontiguousarray(values.swapaxes(0, 1))


def read_arrays(path: str | os.PathLike[str]) -> Arrays:
    """Reads the head of a file of arrays and maps the rest. Raises InvalidTable for anything else, and OSError."""
    file = Path(path)
    size = file.stat().st_size
    with open(file, "rb") as stream:
        line = stream.readline(LONGEST_HEAD)
    try:
        head = json.loads(line)
        sections = head.pop("arrays")
        arrays: dict[str, npt.NDArray[Any]] = {}
        for section in sections:
            dtype, shape = np.dtype(section["dtype"]), tuple(section["shape"])
            if section["offset"] + dtype.itemsize * int(np.prod(shape, dtype=object)) > size:
                raise InvalidTable(f"{file}: array {section['name']} ends beyond the file")
            arrays[section["name"]] = np.memmap(file, dtype, "r", section["offset"], shape)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidTable(f"{file}: not a file of arrays that gonio writes: {error}") from error
    return Arrays(head, arrays)
