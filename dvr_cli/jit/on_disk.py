"""Kernels that are kept on disk."""

from __future__ import annotations

import pickle
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, cast
from zlib import crc32

from llvmlite.binding import add_symbol, parse_bitcode
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import _nrt
from numba.core.serialize import dumps

from dvr_cli.kept import last_change


class _LoadedLibrary(JITCodeLibrary):
    """The code of a kernel that was kept on disk, of which the machine code is loaded at once.

    numba's own reads all of the bitcode, too, which only other kernels need that link it.
    """

    def __init__(self, codegen: Any, name: str, machine_code: bytes, bitcode: bytes) -> None:
        super().__init__(codegen, name)
        self._bitcode = bitcode
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """The address of the function by which Python calls the kernel."""
        return int(self._codegen._engine.get_function_address(name))

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = parse_bitcode(self._bitcode)
        return self._shared_module


class _KernelCacheImpl(CompileResultCacheImpl):
    """Keeps of a kernel what numba keeps, but for environments of parts that hold nothing.

    Nothing looks into these; to make them, modules of numba would be imported that only compile.
    """

    def reduce(self, result: CompileResult) -> tuple[int, bytes]:
        """The parts of a kernel that are kept, as bytes after their checksum."""
        *fields, environments = super().reduce(result)
        kept = dumps((*fields, tuple(each for each in environments if each.consts)))
        return crc32(kept), kept

    def rebuild(self, target_context: Any, payload: tuple[int, bytes]) -> CompileResult:
        """The kernel, of which no bitcode is read; ValueError if it is not what was kept."""
        checksum, kept = payload
        if crc32(kept) != checksum:
            raise ValueError("damaged machine code")
        code, fndesc, environment, signature, *_, reload_init, environments = pickle.loads(kept)
        name, _, (machine_code, bitcode) = code
        for initialise in reload_init:
            initialise()
        _name_helpers()
        codegen = target_context.codegen()
        library = _LoadedLibrary(codegen, name, machine_code, bitcode)
        entry = target_context.get_executable(library, fndesc, environment)
        for each in environments:
            codegen.set_env(each.env_name, each)
        fields = dict.fromkeys(CompileResult._fields) | {
            "target_context": target_context,
            "typing_context": target_context.typing_context,
            "library": library,
            "environment": environment,
            "entry_point": entry,
            "fndesc": fndesc,
            "signature": signature,
            "objectmode": False,
            "reload_init": reload_init,
            "referenced_envs": environments,
        }
        return CompileResult(**fields)


class KernelCache(FunctionCache):
    """numba's cache, which loads without a look through all that numba knows: only compiling needs one.

    A run never fails because of it: what cannot be read is compiled anew, what cannot be written is not kept.
    """

    _impl_class = _KernelCacheImpl

    def load_overload(self, signature: Any, target_context: Any) -> CompileResult | None:
        """The kernel for a signature, or None if it has to be compiled."""
        with suppress(Exception):  # a damaged file may raise anything
            return cast("CompileResult | None", self._load_overload(signature, target_context))
        return None

    def save_overload(self, signature: Any, data: CompileResult) -> None:
        """Keep a kernel; an index that cannot be read makes room for a new one."""
        try:
            super().save_overload(signature, data)
        except Exception:
            with suppress(Exception):  # a disk that is full, or may not be written to
                self.flush()
                super().save_overload(signature, data)


@cache
def _name_helpers() -> None:
    """Name to the linker the functions in C that count references, as numba does before it compiles."""
    for name, address in _nrt.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


@cache
def forget_outdated(directory: str) -> None:
    """Remove from a directory of results those older than the last change of any source they may come from.

    numba notices when the file of a function changes, but not those of the functions and constants it uses.
    """
    with suppress(OSError):
        for index in Path(directory).glob("*.nbi"):
            if index.stat().st_mtime < last_change():
                index.unlink()
