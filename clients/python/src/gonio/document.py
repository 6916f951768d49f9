"""Job documents as people hand them over, made into what the program and the service read.

A document is that of `gonio run` (a mapping, or the path of a JSON file). Two things are allowed on top: NumPy
arrays and numbers wherever the document has lists and numbers, and an array as `grid` of the surface, which
travels as a .npy file: float64 heights of any size, row 0 at y = 0.
"""
from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .errors import Refused

JobDocument = Mapping[str, Any] | str | os.PathLike[str]


def read_document(job: JobDocument | None, members: Mapping[str, Any]) -> dict[str, Any]:
    """The document with `members` in place of its own. Its relative input files become absolute: beside the JSON
    file, or in the current folder for a mapping. Raises Refused."""
    folder = Path.cwd()
    if job is None:
        document = dict(members)
    elif isinstance(job, Mapping):
        document = {**job, **members}
    else:
        folder = Path(job).resolve().parent
        document = {**_read_json(Path(job)), **members}
    if isinstance(document.get("surface"), Mapping):
        document["surface"] = dict(document["surface"])
    if "material" in document:
        document["material"] = _copied(document["material"])
    for files in file_members(document):
        if isinstance(files.get("file"), (str, os.PathLike)):
            files["file"] = str(folder / files["file"])
        if isinstance(files.get("files"), (list, tuple)):
            files["files"] = [str(folder / path) for path in files["files"]]
    return document


def file_members(document: dict[str, Any]) -> list[dict[str, Any]]:
    """The parts of a document that may name files: the surface, the environment, and any number of the material."""
    parts = [document.get("surface"), document.get("environment"), *_objects(document.get("material"))]
    return [part for part in parts if isinstance(part, dict)]


def _copied(value: Any) -> Any:
    """Mappings and lists of them anew, down to what is neither."""
    if isinstance(value, Mapping):
        return {key: _copied(member) for key, member in value.items()}
    return [_copied(member) for member in value] if isinstance(value, (list, tuple)) else value


def _objects(value: Any) -> list[dict[str, Any]]:
    """All mappings inside, itself included."""
    inside = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    return ([value] if isinstance(value, dict) else []) + [found for member in inside for found in _objects(member)]


def document_text(document: Any) -> str:
    """JSON of a document. Raises Refused for what JSON cannot say."""
    try:
        return json.dumps(document, allow_nan=False, default=_plain)
    except (TypeError, ValueError) as error:
        raise Refused(f"the job document: {error}", "invalid_input") from error


def write_array(array: Any, file: BinaryIO, pointer: str = "") -> None:
    """Writes heights as .npy. Masked points become NaN, which the key `missing` of the surface is about."""
    heights = np.asarray(np.where(array.mask, np.nan, array.data) if isinstance(array, np.ma.MaskedArray) else array)
    if heights.ndim != 2 or heights.dtype.kind not in "iuf" or heights.size == 0:
        raise Refused(f"an array of {heights.dtype} with shape {heights.shape}: must be 2-D, of real numbers",
                      "invalid_input", pointer)
    if heights.dtype not in (np.float32, np.float64):
        heights = heights.astype(np.float64)
    np.save(file, np.ascontiguousarray(heights), allow_pickle=False)


def _read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise Refused(f"{path}: {error}", "not_found" if isinstance(error, OSError) else "invalid_input") from error
    if not isinstance(document, dict):
        raise Refused(f"{path}: a job document is a JSON object", "invalid_input")
    return document


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{value!r} has no JSON")
