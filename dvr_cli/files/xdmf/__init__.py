"""XDMF files (.xdmf, .xmf) and the HDF5 or raw files with their arrays, read and patched losslessly."""

from dvr_cli.files.xdmf.source import XdmfSource, read

__all__ = ["XdmfSource", "read"]
