"""Reflectance as coefficients of spherical harmonics: what jobs with "project" give."""
from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InvalidTable

Doubles = npt.NDArray[np.float64]
VERSION = 1


@dataclass(frozen=True)
class Projection:
    """g = f cos(theta_i) cos(theta_o) (weighting "cosine") or g = f ("none"), in 1/sr, in spherical harmonics.

    basis: "sh", real and orthonormal without Condon-Shortley phase, or "hsh", orthonormal over the upper hemisphere.
    order: of bands 0 to order - 1; coefficient (l, m) stands at l * (l + 1) + m.
    form: "per_light", a set of coefficients of the view for each row of `incident`; "matrix", light x view; "joint",
        reciprocal and, if `isotropic`, unchanged by turns around z.
    coefficients, standard_error, bias: [channel][order of scattering][incident, if per_light][coefficient]; of a
        matrix, coefficient = light * order**2 + view. `names` are the columns of `labels`, a row a coefficient.
    relative_error, ridge: [channel][order of scattering][incident, if per_light]; rms error of the reconstructed g over
        rms g, of samples each held out in turn.
    condition_number: of the fit. isotropy_defect: rms change when turned around z over rms g, and what noise explains
        of it; None where it was not measured.
    """

    basis: str
    order: int
    weighting: str
    form: str
    isotropic: bool
    channels: tuple[str, ...]
    incident: Doubles
    names: tuple[str, ...]
    labels: npt.NDArray[np.intp]
    coefficients: Doubles
    standard_error: Doubles
    bias: Doubles
    relative_error: Doubles
    ridge: Doubles
    condition_number: float
    isotropy_defect: tuple[float, float] | None
    provenance: Mapping[str, str]

    def f(self, theta_i: npt.ArrayLike, phi_i: npt.ArrayLike, theta_o: npt.ArrayLike, phi_o: npt.ArrayLike,
          channel: str | None = None, order: int = 0) -> Doubles:
        """The BRDF in 1/sr at angles in degrees, which broadcast. Of a projection per light, the light is the nearest.

        channel: default the first. order: of scattering, 0 for the sum of all.
        """
        number = 0 if channel is None else self.channels.index(channel)
        angles = np.broadcast_arrays(*(np.asarray(angle, dtype=np.float64) for angle in (theta_i, phi_i, theta_o, phi_o)))
        view = harmonics(self.basis, self.order, angles[2], angles[3])
        c = self.coefficients[number, order]
        if self.form == "per_light":
            towards = _unit(angles[0], angles[1]) @ _unit(*self.incident.T).T
            g = np.einsum("...k,...k->...", c[towards.argmax(axis=-1)], view)
        else:
            light = harmonics(self.basis, self.order, angles[0], angles[1])
            g = np.einsum("...a,ab,...b->...", light, self.matrix(number, order), view)
        if self.weighting == "cosine":
            g = g / (np.cos(np.radians(angles[0])) * np.cos(np.radians(angles[2])))
        return np.asarray(g, dtype=np.float64)

    def matrix(self, channel: int = 0, order: int = 0) -> Doubles:
        """Coefficients of light (rows) times view (columns), also of a joint projection."""
        c, count = self.coefficients[channel, order], self.order**2
        if self.form == "matrix":
            return np.asarray(c.reshape(count, count), dtype=np.float64)
        if self.form != "joint":
            raise ValueError("a projection per light is no matrix")
        result = np.zeros((count, count))
        for value, (l_i, m_i, l_o, m_o) in zip(c, self.labels):
            terms = {(l_i, m_i, l_o, m_o), (l_o, m_o, l_i, m_i)}
            if self.isotropic:
                terms |= {(l, -m, k, -n) for l, m, k, n in terms}
            for l, m, k, n in terms:
                result[l * (l + 1) + m, k * (k + 1) + n] += value / np.sqrt(len(terms))
        return result


def harmonics(basis: str, order: int, theta: npt.ArrayLike, phi: npt.ArrayLike) -> Doubles:
    """y_lm of all bands below `order` at angles in degrees: the last axis is l * (l + 1) + m."""
    theta, phi = np.broadcast_arrays(np.radians(np.asarray(theta, dtype=float)), np.radians(np.asarray(phi, dtype=float)))
    z = 2 * np.cos(theta) - 1 if basis == "hsh" else np.cos(theta)
    sine = np.sqrt(np.maximum(0, 1 - z * z))
    y = np.empty((*z.shape, order * order))
    sectoral = np.full(z.shape, np.sqrt((2 if basis == "hsh" else 1) / (4 * np.pi)))
    for m in range(order):
        if m:
            sectoral = sectoral * np.sqrt((2 * m + 1) / (2 * m)) * sine
        before, legendre = np.zeros_like(z), sectoral
        for l in range(m, order):
            if l > m:
                a = np.sqrt((4 * l * l - 1) / (l * l - m * m))
                b = np.sqrt(((l - 1) ** 2 - m * m) / (4 * (l - 1) ** 2 - 1))
                before, legendre = legendre, a * (z * legendre - b * before)
            y[..., l * (l + 1) + m] = legendre * (np.sqrt(2) * np.cos(m * phi) if m else 1)
            if m:
                y[..., l * (l + 1) - m] = legendre * np.sqrt(2) * np.sin(m * phi)
    return y


def read_projection(path: str | os.PathLike[str]) -> Projection:
    """The projection in a JSON file. Raises InvalidTable, also for a file that cannot be read."""
    try:
        return parse_projection(Path(path).read_bytes())
    except OSError as error:
        raise InvalidTable(f"{path}: {error.strerror}") from error
    except InvalidTable as error:
        raise InvalidTable(f"{path}: {error}") from error


def parse_projection(content: bytes) -> Projection:
    """The projection in the bytes of a JSON file. Raises InvalidTable."""
    try:
        root = json.loads(content)
        if root["format"] != "gonio-projection" or root["version"] != VERSION:
            raise InvalidTable(f"{root['format']} {root['version']}: must be gonio-projection {VERSION}")
        return _from_json(root)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise InvalidTable(f"no gonio projection: {error}") from error


def _from_json(root: Any) -> Projection:
    plan, axes, shape = root["projection"], {axis["name"]: axis for axis in root["axes"]}, root["shape"]
    defect = root.get("isotropy_defect")
    arrays = [np.array(root[name], dtype=np.float64).reshape(shape) for name in ("coefficients", "standard_error", "bias")]
    errors = [np.array(root[name], dtype=np.float64).reshape(shape[:-1]) for name in ("relative_error", "ridge")]
    return Projection(plan["basis"], plan["order"], plan["weighting"], plan["form"], plan.get("isotropic", False),
                      tuple(axes["channel"]["values"]),
                      np.array(axes["incident"]["values"] if "incident" in axes else [], dtype=np.float64).reshape(-1, 2),
                      tuple(axes["coefficient"]["columns"]), np.array(axes["coefficient"]["values"], dtype=np.intp),
                      arrays[0], arrays[1], arrays[2], errors[0], errors[1], root["condition_number"],
                      (defect["measured"], defect["noise"]) if defect else None, dict(root["provenance"]))


def _unit(theta: Any, phi: Any) -> Doubles:
    theta, phi = np.radians(theta), np.radians(phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
