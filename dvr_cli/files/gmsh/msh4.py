"""Reading the sections of MSH 4.1 and 4.0, ASCII and binary: nodes and elements come in blocks by entity.

In 4.0 a point has a bounding box, each node its tag in front of its coordinates, an entity its tag in front
of its dimension, and tags take 4 bytes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dvr_cli.errors import InputError
from dvr_cli.files.gmsh.cells import cell_type
from dvr_cli.files.gmsh.elements import MAX_GROUPS, Elements
from dvr_cli.files.gmsh.nodes import NodeBlocks, Nodes
from dvr_cli.files.gmsh.numbers import Numbers
from dvr_cli.mesh.mesh import Entity


class Entities(NamedTuple):
    """The entities of a model, as far as they are known.

    physical: the physical tags of every entity that has some. whole: the tag of the entity of which one of
    the same dimension is the part in one partition. between: those that lie between partitions, which
    partitioning made.
    """

    physical: dict[Entity, list[int]]
    whole: dict[Entity, int]
    between: set[Entity]


def read_entities(numbers: Numbers, partitioned: bool, into: Entities, older: bool) -> None:
    """Read $Entities, or $PartitionedEntities, ``into`` what is known.

    Gmsh gives a group a negative tag where it runs against the entity's orientation; the sign is dropped.
    """
    if partitioned:
        numbers.record("q")  # number of partitions
        (ghosts,) = numbers.record("q")
        numbers.skip("i", 2 * ghosts)
    for dimension, entities in enumerate(numbers.record("4q")):
        box = "3dq" if dimension == 0 and not older else "6dq"
        for _ in range(entities):
            if partitioned:
                tag, parent_dimension, parent, partitions = numbers.record("3iq")
                if parent_dimension == dimension:
                    into.whole[dimension, tag] = parent
                else:
                    into.between.add((dimension, tag))
                numbers.skip("i", partitions)
                groups = numbers.record(box)[-1]
            else:
                tag, *_, groups = numbers.record("i" + box)
            if groups:
                tags = numbers.integers("i", groups)
                if groups > MAX_GROUPS:
                    raise InputError(f"an entity is in {groups} physical groups; dvr takes {MAX_GROUPS}")
                into.physical[dimension, tag] = abs(tags).tolist()
            if dimension > 0:
                (bounds,) = numbers.record("q")
                numbers.skip("i", bounds)
    numbers.finish()


def read_nodes(numbers: Numbers, whole: dict[Entity, int], older: bool) -> Nodes:
    """Read $Nodes. Parametric coordinates are passed over; the layout says where they are.

    whole: see ``Entities``.
    """
    unit = numbers.length["d"]
    blocks, declared = numbers.record("2q" if older else "4q")[:2]
    tags, points, layout = [], [], []
    inside: dict[Entity, list[np.ndarray]] = {}
    end = 0
    for _ in range(blocks):
        flag = numbers.position + 2 * numbers.length["i"]
        dimension, entity, parametric, count = numbers.record("3iq")
        if older:
            dimension, entity = entity, dimension
        if not 0 <= dimension <= 3 or parametric not in (0, 1):
            raise InputError(f"section ${numbers.name} is damaged: a block of nodes has a wrong header")
        parameters = dimension if parametric else 0
        stride = (3 + parameters) * unit
        if older:
            first = numbers.position + numbers.length["i"]
            stride += numbers.length["i"]
            labels, values = numbers.tagged(count, 3 + parameters)
        else:
            labels = numbers.integers("q", count)
            first = numbers.position
            values = numbers.doubles(count * (3 + parameters)).reshape(count, 3 + parameters)
        tags.append(labels)
        points.append(values[:, :3])
        begin, end = end, end + count
        if dimension in (1, 2):
            entity = whole.get((dimension, entity), entity)
            inside.setdefault((dimension, entity), []).append(np.arange(begin, end))
        layout.append((first, count, stride, parameters * unit, parameters > 0, flag))
    numbers.finish()
    nodes = Nodes.join(tags, points, NodeBlocks.of(layout))
    if len(nodes.tags) != declared:
        raise InputError(f"section $Nodes declares {declared} nodes and holds {len(nodes.tags)}")
    return nodes._replace(entities={key: np.concatenate(parts) for key, parts in inside.items()})


def read_elements(numbers: Numbers, entities: Entities, older: bool) -> tuple[list[Elements], int]:
    """Read $Elements; the physical tags of an element are those of its entity, or 0.

    Elements of a partition count to the entity that was partitioned. Elements between partitions are left
    out, as they bound nothing but these; how many is returned, too.
    """
    blocks, declared = numbers.record("2q" if older else "4q")[:2]
    elements: list[Elements] = []
    left_out = 0
    for _ in range(blocks):
        dimension, entity, code, count = numbers.record("3iq")
        if older:
            dimension, entity = entity, dimension
        width = 1 + cell_type(code).nodes
        table = numbers.integers("i" if older else "q", count * width).reshape(count, width)
        if (dimension, entity) in entities.between:
            left_out += count
            continue
        groups = entities.physical.get((dimension, entity), [0])
        elements.append(
            Elements(
                code,
                numbers=table[:, 0],
                nodes=table[:, 1:],
                geometrical=np.full(count, entities.whole.get((dimension, entity), entity)),
                physical=np.full((count, len(groups)), groups),
            )
        )
    numbers.finish()
    held = sum(len(block.numbers) for block in elements) + left_out
    if held != declared:
        raise InputError(f"section $Elements declares {declared} elements and holds {held}")
    return elements, left_out


def read_periodic(numbers: Numbers) -> np.ndarray:
    """Read $Periodic: (K, 2) node tags, slave and master."""
    pairs = [np.empty((0, 2), np.int64)]
    (links,) = numbers.record("q")
    for _ in range(links):
        numbers.skip("i", 3)
        (affine,) = numbers.record("q")
        numbers.skip("d", affine)
        (count,) = numbers.record("q")
        pairs.append(numbers.integers("q", 2 * count).reshape(count, 2))
    numbers.finish()
    return np.concatenate(pairs)
