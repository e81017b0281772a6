"""Universal files of I-DEAS (.unv, .uff): nodes, elements and groups in numbered datasets."""

from dvr_cli.files.unv.source import read

__all__ = ["read"]
