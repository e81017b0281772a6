"""UCD files of AVS (.avs, .inp): text with a material for each cell."""

from dvr_cli.files.avsucd.convert import convert
from dvr_cli.files.avsucd.source import read

__all__ = ["convert", "read"]
