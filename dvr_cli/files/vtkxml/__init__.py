"""VTK's XML files, read and patched losslessly: UnstructuredGrid (.vtu) and PolyData (.vtp)."""
