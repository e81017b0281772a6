"""The Python interface: what the commands do, on meshes in memory."""
