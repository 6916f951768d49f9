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
    where they are looked at.
    """

    head: dict[str, Any]
    arrays: dict[str, npt.NDArray[Any]]

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self.arrays[name]

    def images(self, view: int) -> npt.NDArray[np.float32]:
        """Of a BTF or light field in either form: [light, channel, row, column] of one view, in 1/sr, row 0 at low y.

        Both forms give the same values.
        """
        return self._halves(view).astype(np.float32)

    def save_images(self, path: str | os.PathLike[str]) -> Path:
        """Writes all images of a BTF or light field in either form as .npy, whole or not at all, and returns the path.

        Half floats [view, light, channel, row, column] in 1/sr, one view after the other: the array of the job's
        output "npy", and its last line, which says what the numbers are.
        """
        target = Path(path)
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        first = self._halves(0)
        header = {"descr": first.dtype.str, "fortran_order": False, "shape": (self.head["n_views"], *first.shape)}
        said = {"axes": ["view", "light", "channel", "row", "column"], "mean_axes": ["channel", "light", "view"]}
        errors = {name: self.arrays[name].tolist() for name in ("mean", "mean_se", "mean_bias", "pixel_se")}
        write_header: Any = np.lib.format.write_array_header_1_0  # untyped in some versions of NumPy
        try:
            with open(part, "wb") as file:
                write_header(file, header)
                for view in range(self.head["n_views"]):
                    file.write(np.ascontiguousarray(self._halves(view)).data)
                file.write(f"\n{json.dumps(said | errors | self.head | {'form': 'images'})}\n".encode())
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
        return target

    def _halves(self, view: int) -> npt.NDArray[np.float16]:
        if "images" in self.arrays:
            return np.asarray(self.arrays["images"][view], np.float16)
        radiance, maps = self.arrays["facet_radiance"], self.arrays["view_maps"][view]
        total = np.zeros((*radiance.shape[:2], *maps.shape[1:]), np.float32)
        for seen in maps:  # in the order of the program, whose rounding this is
            total += radiance[:, :, seen]
        return (total * (np.float32(1) / np.float32(len(maps)))).astype(np.float16).swapaxes(0, 1)


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
