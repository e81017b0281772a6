"""The contents of an Exodus file beyond the mesh, by kind and count."""

from __future__ import annotations

from dvr_cli.files.losses import number_not_kept
from dvr_cli.files.netcdf import NetCDF

# dimension: what it counts
_COUNTED = {
    "time_step": "time step",
    "num_glo_var": "global variable",
    "num_nset_var": "node set variable",
    "num_sset_var": "side set variable",
    "num_qa_rec": "QA record",
    "num_info": "information record",
    "num_node_maps": "node map",
    "num_elem_maps": "element map",
    "num_ed_blk": "edge block",
    "num_fa_blk": "face block",
    "num_edge_sets": "edge set",
    "num_face_sets": "face set",
    "num_as": "assembly",
    "num_blob": "blob",
}
# beginning of the names of variables: what each of them is
_LISTED = {
    "attrib": "set of element attributes",
    "dist_fact": "set of distribution factors",
    "coor_frames": "set of coordinate frames",
}
_NUMBERED = {
    "node_num_map": "numbers of nodes",
    "elem_num_map": "numbers of elements",
    "elem_map": "an order of elements",
}


def beyond_mesh(file: NetCDF) -> list[str]:
    """One line for each kind of thing in the file that is not in the mesh read from it."""
    lines = [
        line for name, what in _COUNTED.items() for line in number_not_kept(file.length(name) or 0, what)
    ]
    for start, what in _LISTED.items():
        lines += number_not_kept(sum(name.startswith(start) for name in file.names), what)
    return lines + [f"not kept: {what}" for name, what in _NUMBERED.items() if name in file]
