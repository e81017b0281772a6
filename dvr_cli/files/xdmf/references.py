"""DataItems that refer to others by their path, as PETSc writes them.

    <DataItem Name="cells" Format="HDF" Dimensions="4 3">mesh.h5:/cells</DataItem>
    ...
    <DataItem Reference="XML">/Xdmf/Domain/DataItem[@Name="cells"]</DataItem>

The path stands in the element or is the value of the attribute.
"""

from __future__ import annotations

import re

from dvr_cli.errors import InputError
from dvr_cli.files.numbers_in_text import shown
from dvr_cli.files.xml_places import Element

_STEP = re.compile(r"/(\w+)(?:\[(?:(\d{1,9})|@(\w+)=(?:\"([^\"]*)\"|'([^']*)'))\])?")


def follow_references(data: bytes, root: Element) -> None:
    """Put the DataItems referred to in the places of those that refer to them; raises InputError."""
    for parent in list(root.walk()):
        for i, child in enumerate(parent.children):
            if child.name == "DataItem" and "Reference" in child.attributes:
                parent.children[i] = _target(data, root, child)


def _target(data: bytes, root: Element, item: Element) -> Element:
    begin, end = item.text
    given = item.attributes["Reference"]
    path = data[begin:end].decode("utf-8", "replace").strip() if given.upper() == "XML" else given
    found = [Element("", {}, 0, children=[root])]
    done = 0
    for step in _STEP.finditer(path):
        if step.start() != done:
            break
        done = step.end()
        name, number, key, *values = step.groups()
        found = [child for element in found for child in element.named(name)]
        if number:
            found = found[int(number) - 1 : int(number)]
        elif key:
            found = [element for element in found if element.attributes.get(key) in values]
    if (
        done != len(path)
        or len(found) != 1
        or found[0].name != "DataItem"
        or "Reference" in found[0].attributes
    ):
        raise InputError(
            f"a DataItem that refers to another by {shown(path)}, where there is not one, is not supported"
        )
    return found[0]
