"""The paths of the HDF5 and raw files of an XDMF output: never those of files that do not belong to it."""

from __future__ import annotations

import os
from pathlib import Path

from dvr_cli.errors import InputError, OutputError
from dvr_cli.files.xdmf.items import item_of
from dvr_cli.files.xml_places import parse


def references(data: bytes) -> set[str]:
    """The files that the DataItems of an XDMF file name, as they name them; none if it cannot be read."""
    found = set()
    try:
        for element in parse(data, entities=True).walk():
            if element.name == "DataItem" and not element.children and "Reference" not in element.attributes:
                found.add(item_of(data, element).file)
    except InputError:
        pass
    return found - {""}


def places(source: Path, target: Path, moved: list[str], kept: list[str]) -> dict[str, str]:
    """By the name of each file that has to be written for the output, the name it gets there.

    source, target: the XDMF files; moved: the files with the coordinates; kept: the others of the input.
    In place, and in another directory where nothing is in the way, files keep their names. Else those with
    coordinates are named after the target. Raises OutputError where a foreign file is in the way.
    """
    if _real(source) == _real(target):
        return {name: name for name in moved}
    old = owned(target)
    own = {_real(source.parent / name) for name in (*moved, *kept)}
    same_folder = _real(source.parent) == _real(target.parent)
    result: dict[str, str] = {}
    for name in moved:
        path = target.parent / name
        free = path.parent.is_dir() and (not path.exists() or _real(path) in old) and _real(path) not in own
        result[name] = name if free and not same_folder and not Path(name).is_absolute() else ""
    for i, name in enumerate(name for name, new in list(result.items()) if not new):
        new = f"{target.stem}{f'_{i}' if i else ''}{Path(name).suffix}"
        path = target.parent / new
        if new in result.values() or _real(path) in own or (path.exists() and _real(path) not in old):
            raise OutputError(f"{path} is in the way and does not belong to the output; choose another name")
        result[name] = new
    for name in kept if not same_folder else ():
        path = target.parent / name
        if Path(name).is_absolute():
            continue
        if name in result.values() or not path.parent.is_dir() or (path.exists() and _real(path) not in old):
            raise OutputError(
                f"{path} belongs to the output, but cannot be written or is another file already"
            )
        result[name] = name
    return result


def owned(target: Path) -> set[Path]:
    """The files that belong to what is at ``target`` now."""
    if not target.is_file():
        return set()
    return {_real(target.parent / name) for name in references(target.read_bytes())}


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
