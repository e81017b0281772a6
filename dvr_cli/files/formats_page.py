"""The page of the documentation about formats, from their records: python -m dvr_cli.files.formats_page."""

from __future__ import annotations

from dvr_cli.files.formats import REGISTRY, Format

_HEAD = """# File formats

This page is made from the records in `dvr_cli/files/formats.py`:
`python -m dvr_cli.files.formats_page > docs/formats.md`.

*Patched*: where input and output have the same format, coordinates change and nothing else. *Written from
others*: files of other formats can be converted to it; what that loses is said. *Regions*: what binds
interfaces under `--boundary fixed`. *Checked by*: other packages
that read these files in the tests.

"""
_COLUMNS = (
    "format",
    "suffixes",
    "versions",
    "patched",
    "written from others",
    "regions",
    "refused",
    "checked by",
)


def formats_page() -> str:
    """The page, in Markdown."""
    head = [_line(_COLUMNS), _line(("---",) * len(_COLUMNS))]
    return "".join([_HEAD, *head, *map(_row, REGISTRY)])


def _row(record: Format) -> str:
    if record.converter is None:
        converted = "no"
    else:
        converted = "through meshio" if record.converter == "meshio_source" else "yes"
    cells = (
        f"`{record.name}`",
        " ".join(record.suffixes),
        record.versions or "as meshio reads it",
        "yes" if record.patched else "no: read only",
        converted,
        record.regions or "tags, as meshio reads them" if not record.patched else record.regions or "none",
        record.refused or "-",
        ", ".join(record.checked_by) or "-",
    )
    return _line(cells)


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |\n"


if __name__ == "__main__":
    print(formats_page(), end="")
