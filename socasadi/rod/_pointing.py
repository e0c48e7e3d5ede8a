import numpy as np

from ._checks import vector


def pointing(direction: object) -> tuple[tuple[float, ...], ...]:
    """Rotation matrix (3, 3) that turns +x to ``direction`` (3,) by the shortest way: a ``base_rotation``.

    Raises
    ------
    ValueError
        The direction is not three finite numbers, or all are zero.

    Examples
    --------
    A rod that stands upright, with its own +y where the world has it:

    >>> pointing((0, 0, 1))
    ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    """
    wanted = vector("pointing", "direction", direction, 3)
    size = np.linalg.norm(wanted)
    if size == 0:
        raise ValueError(f"pointing: direction is {wanted.tolist()}, which points nowhere")
    x, y, z = wanted / size
    if x < -1 + 1e-12:  # any half turn will do: the one about z
        return (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
    rotation = np.array(
        [[x, -y, -z], [y, 1 - y * y / (1 + x), -y * z / (1 + x)], [z, -y * z / (1 + x), 1 - z * z / (1 + x)]]
    )
    return tuple(tuple(row) for row in (rotation + 0.0).tolist())
