"""What docs/distributed.md does with meshes of other libraries, done with those of Debian, on Open MPI."""

import pytest


@pytest.mark.long
@pytest.mark.parametrize("name", ["with_dolfinx.py", "with_petsc.py"])
def test_a_distributed_mesh_comes_out_as_from_the_whole(on_debian, tmp_path, name):
    done = on_debian(3, "debian_libraries.py", name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
