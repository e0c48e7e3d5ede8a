"""An episode as bytes: a compressed .npz archive of its arrays, and its other fields as JSON text."""

import io
import json
from dataclasses import fields
from typing import Any

import numpy as np

from ..experiment import Episode


def pack(episode: Episode) -> bytes:
    """``episode`` as bytes, without pickle."""
    values = {field.name: getattr(episode, field.name) for field in fields(episode)}
    arrays: dict[str, Any] = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    about = {name: value for name, value in values.items() if name not in arrays}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(json.dumps(about)), **arrays)
    return buffer.getvalue()


def unpack(blob: bytes) -> Episode:
    """What :func:`pack` packed; what it raises when the bytes are damaged, the journal answers for."""
    with np.load(io.BytesIO(blob), allow_pickle=False) as data:
        about = json.loads(data["about"].item())
        return Episode(**about, **{name: data[name] for name in data if name != "about"})
