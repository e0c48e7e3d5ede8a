import shutil
from pathlib import Path

from ._errors import ExportError

_MANIFEST = ".socasadi-export"
"""Lists what an export wrote into its folder, which the next one there replaces."""


def claim(folder: Path, names: list[str]) -> None:
    """Make the folder, or clear it of an earlier export, having seen that none of these names is somebody else's."""
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder} is a file; name a folder for the C files")
    manifest = folder / _MANIFEST
    # Names in the folder itself, whatever may have been written into the list.
    ours = {Path(name).name for name in manifest.read_text().splitlines()} if manifest.is_file() else set()
    if others := sorted(name for name in names if (folder / name).exists() and name not in ours):
        raise ExportError(
            f"{folder} has files of the same names that are not an export's ({', '.join(others)}); choose another"
        )
    for name in ours:
        if (folder / name).is_dir():
            shutil.rmtree(folder / name)
        else:
            (folder / name).unlink(missing_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    manifest.write_text("\n".join(names) + "\n")
