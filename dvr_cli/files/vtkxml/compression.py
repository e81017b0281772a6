"""The compressors of VTK's XML files, each a record."""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass

from dvr_cli.errors import InputError

_MEMORY = 1 << 29  # bytes that the decoder of xz may take for itself


@dataclass(frozen=True)
class Compressor:
    """compress: a block; decompress: a block and its size before, which it has to have (else ValueError)."""

    compress: Callable[[bytes], bytes]
    decompress: Callable[[bytes, int], bytes]


def _inflate(block: bytes, size: int) -> bytes:
    try:
        return _exact(zlib.decompressobj().decompress(block, size + 1), size)
    except zlib.error as error:
        raise ValueError(str(error)) from error


def _unxz(block: bytes, size: int) -> bytes:
    try:
        return _exact(lzma.LZMADecompressor(memlimit=_MEMORY).decompress(block, size + 1), size)
    except (lzma.LZMAError, EOFError) as error:
        raise ValueError(str(error)) from error


def _exact(data: bytes, size: int) -> bytes:
    if len(data) != size:
        raise ValueError("a block of another size")
    return data


def _lz4() -> Compressor:
    try:
        import lz4.block as lz4
    except ImportError as error:
        raise InputError("LZ4 compression needs the package lz4 (pip install 'dvr-cli[formats]')") from error

    def decompress(block: bytes, size: int) -> bytes:
        if size > 255 * len(block):  # the most that LZ4 can do
            raise ValueError("a block of another size")
        try:
            return _exact(lz4.decompress(block, uncompressed_size=size), size)
        except lz4.LZ4BlockError as error:
            raise ValueError(str(error)) from error

    return Compressor(lambda block: lz4.compress(block, store_size=False), decompress)


_COMPRESSORS: dict[str, Callable[[], Compressor]] = {
    "vtkZLibDataCompressor": lambda: Compressor(lambda block: zlib.compress(block, 5), _inflate),
    "vtkLZ4DataCompressor": _lz4,
    "vtkLZMADataCompressor": lambda: Compressor(
        lambda block: lzma.compress(block, check=lzma.CHECK_CRC32, preset=5), _unxz
    ),
}


def compressor_named(name: str) -> Compressor:
    """The compressor VTK calls ``name``; raises InputError for others, and for LZ4 where lz4 is missing."""
    if name not in _COMPRESSORS:
        raise InputError(f"the compressor {name[:40]!r} is not supported")
    return _COMPRESSORS[name]()
