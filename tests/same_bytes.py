"""Whether two checkouts give the same bytes: kept only as long as the redesign of the package runs.

    python tests/same_bytes.py OTHER_CHECKOUT [--only SUBSTRING] [--small] [--this CHECKOUT] [--cache FOLDER]

Every command of a long list runs in both checkouts, OTHER being the reference. Exit codes, stdout, stderr,
meshes, reports and pictures must be alike but for seconds, the version and traces of errors. One line a
difference is printed, then the counts; the exit code is 1 if anything differs. It is no test: pytest does
not collect it.

The inputs are made once, by the reference, and kept with what the reference gave (by commit and command) in
the cache, so that the next comparison costs half. ``--small`` takes a choice that covers every module.
``--list`` prints the commands, ``--fill`` computes the reference alone. What differs is kept in
CACHE/differs/: the outputs of both checkouts, as folders a (the reference) and b.

A command is a line of arguments to ``dvr``, run in a folder of its own where ``in`` leads to the inputs.
``< FILE`` feeds it, ``tty`` before it connects it to a terminal of 80 columns, ``api NAME`` calls one of the
functions ``api_*`` below instead, ``;`` goes on with another, and ``cp A B`` copies an input.
"""

# ruff: noqa: E501, SIM905 - the commands are read more easily as they would be typed

from __future__ import annotations

import argparse
import hashlib
import inspect
import json
import os
import pty
import re
import shlex
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
LIMIT = 900  # seconds for one command

# ------------------------------------------------------------------------------------------------ commands

SAMPLES = (
    "random_square.msh random_cube.vtk two_materials.msh plate_quads.msh mixed_plane.vtk hex_block.vtu "
    "mixed_solid.vtu panel.obj hexagon.vtk negative_ball.msh"
).split()
VOLUMES = {"random_cube.vtk", "two_materials.msh", "hex_block.vtu", "mixed_solid.vtu", "negative_ball.msh"}

# of every sample and, where they say so, of every other mesh; N stands for the number of sweeps
ON_SAMPLES = """
-v
--engine numpy --no-patches
--engine numba --threads 1
--engine numba --threads 2 -v
--engine numba --threads 2 --patches --polish --floor 0.9
--engine numpy --no-patches -n 3 -v
--engine numpy --no-polish -n 3 --patches -q
--engine numba --no-polish --no-patches
-d random --engine numpy
-d random --engine numba --seed 7
-d x --engine numpy
-d y,random --engine numpy
-d axis --engine numpy
-d axis --engine numba
-d circumferential -n 6 --engine numpy
-d radial,circumferential --center 0.4,0.5 -n 6 --engine numpy
-d steepest -n 4 --engine numpy
-d steepest -n 8 --engine numba
-d optimal -n 2 --engine numpy
-d optimal -n 4 --engine numba
-d random,steepest,axis -n 5 --engine numba --threads 2
-d steepest --polish -n 3 --engine numpy
-d random --patches -n 3 --engine numba
--order natural -n 5 --engine numpy --no-patches
--order natural -n 5 --engine numba --no-patches
--order shuffled --seed 3 -n 5 --engine numpy --no-patches
--order shuffled --seed 3 -n 5 --engine numba
--order natural -d axis -n 4 --engine numpy
--seed 18446744073709551615 -d random -n 3 --engine numpy
--preset paper -n 5 --engine numpy
--preset paper -n 5 --engine numba --seed 2
--boundary slide --engine numpy --no-patches
--boundary slide --engine numba
--boundary slide -d random -n 5 --engine numpy
--boundary slide -d axis,optimal -n 4 --engine numba
--boundary project -n 4 --engine numpy --no-patches
--boundary project --engine numba
--boundary project -n 5 -d random --engine numba --feature-angle 10
--boundary project -n 5 --engine numba --feature-angle 80 --max-deviation 0.05
--boundary project -n 5 --engine numpy --max-deviation 0 --no-patches
--below 0.3 --engine numpy --no-patches
--below 0.3 --layers 1 --engine numpy --no-patches
--below 0.4 --layers 2 --engine numba --boundary slide
--vertices in/vertices.txt --engine numpy --no-patches
--vertices in/vertices.npy --engine numba
--tol 1e-6 --patience 5 -d random --engine numpy
--tol 0 -n 4 -d random --engine numpy
--tol 0.1 --patience 1 --engine numba
--target 0.2 --engine numpy --no-patches
--target 0.2 --engine numba -d random
-n 0 --engine numpy
-n 0 --polish --engine numba
--polish --floor 1 -n 3 --engine numpy -d random
--polish --floor 0.5 -n 3 --engine numba -d random
--untangle --engine numpy --no-patches -n 3
--untangle --boundary slide --engine numba
--straighten -n 2 --engine numpy --no-patches
--time-limit 1000 -n 3 --engine numpy --no-patches
--report r.csv -n 3 --engine numpy --no-patches
--report r.json -n 3 --engine numpy --no-patches --fail-below 0.9
--no-report -n 3 --engine numpy --no-patches
-q -n 3 --engine numpy --no-patches --fail-below 0.1
--fail-below 0.99 -n 2 --engine numpy --no-patches
--debug -n 2 --engine numpy --no-patches
--quality-field -n 2 --engine numpy --no-patches
""".strip().splitlines()

ON_VOLUMES = """
-d z --engine numpy -n 5
-d circumferential,radial --axis 1,1,0 --center 0.5,0.5,0.5 -n 5 --engine numpy
-d circumferential --axis 0,1,0 -n 5 --engine numba
""".strip().splitlines()

ON_OTHERS = """
--engine numpy --no-patches
--engine numba --threads 2
--engine numba -d random,axis -n 6 -v
--engine numpy -d optimal -n 2 --no-report
--engine numpy --boundary slide --no-patches -n 6
--engine numba --boundary slide
--engine numpy --boundary project --no-patches -n 4
--engine numba --boundary project
--engine numpy --untangle --no-patches -n 2
--engine numba --untangle --boundary slide
--engine numpy --preset paper -n 4
--engine numba --below 0.4 --layers 1 --polish
""".strip().splitlines()

BENCHMARKS = (
    "random_tets random_triangles raw_tets raw_tets_along_curve shaken_hexes gmsh_sphere gmsh_part"
).split()
KINDS = "triangle quad tetra hexahedron wedge pyramid mixed2d mixed3d".split()
BOXES = "triangle quad tetra hexahedron".split()
CURVED = "sphere cylinder torus".split()
PARTS = (
    "cube L two-materials inclusion-and-hole split-face embedded crack open-crack plate slit cube-2 plate-2 "
    "plate-quads plate-quads-2 two-materials-2 sphere-2"
).split()
TANGLED = [f"tangled-{kind}.vtk" for kind in BOXES] + [f"bump-{kind}.vtk" for kind in BOXES]
TANGLED += ["turned.vtk", "inverted.msh"]
OTHERS = [f"bench-{name}.vtk" for name in BENCHMARKS] + [f"random-{kind}.vtk" for kind in KINDS] + TANGLED
OTHERS += [f"{what}-{name}.vtk" for what in ("solid", "surface") for name in CURVED] + ["scanned.vtk"]
OTHERS += [f"part-{name}.msh" for name in PARTS]

WRITTEN = (  # the suffixes of formats to convert to
    "msh vtk obj vtu mesh meshb inp bdf su2 off ply stl xdmf med cgns e h5m avs xml f3grid hmf mdpa vol post "
    "dat ugrid node ele"
).split()
READ = (  # meshio's names of the formats that inputs are written in
    "gmsh22 gmsh vtk42 vtk vtu obj medit abaqus nastran su2 off ply stl xdmf med cgns exodus h5m avsucd "
    "dolfin-xml flac3d hmf mdpa netgen permas tecplot ugrid tetgen"
).split()
SUFFIX = {"gmsh22": "msh", "gmsh": "msh", "vtk42": "vtk", "medit": "mesh", "abaqus": "inp", "nastran": "bdf"}
SUFFIX |= {"exodus": "e", "avsucd": "avs", "dolfin-xml": "xml", "flac3d": "f3grid", "netgen": "vol"}
SUFFIX |= {"permas": "post", "tecplot": "dat", "tetgen": "node"}

BAD = (
    "missing.msh directory/dir.msh empty/empty.msh gmsh_cut_in_its_nodes/cut.msh "
    "gmsh_cut_in_its_elements/cut.msh vtk_cut_in_its_points/cut.vtk vtk_cut_in_its_cells/cut.vtk "
    "suffix_of_no_format/mesh.xyz suffix_of_another_format/mesh.msh a_text_that_is_no_mesh/letter.msh "
    "bytes_that_are_no_mesh/noise.vtk no_cells/nocells.vtk only_lines/lines.msh nan_coordinate/nan.vtk "
    "nan_coordinate_in_gmsh/nan.msh infinite_coordinate/inf.vtk index_too_large/index.vtk "
    "index_too_large_in_gmsh/index.msh negative_index/index.vtk repeated_vertex/twice.msh"
).split()

WRONG = """
frobnicate
--frobnicate
report
report frobnicate
report quality
report compare in/fan.msh
report quality in/fan.msh --json --csv
report quality in/fan.msh --worst -1
report quality in/fan.msh --plot p.jpg
report quality in/fan.msh --plot p
report quality in/fan.msh --fail-below nan
report quality in/fan.msh --input-format cuneiform
report quality in/fan.msh --input-format stl
report quality in/fan.msh --debug --input-format vtk
report compare in/fan.msh in/fan.msh --plot p
report compare in/fan.msh in/random_square.msh
report compare in/fan.msh in/missing.msh
morph
morph in/fan.msh
morph in/fan.msh out.msh
morph in/fan.msh out.msh --displacement d.npy --near -1
morph in/fan.msh out.msh --displacement missing.npy
morph in/fan.msh out.msh --displacement in/vertices.txt
morph in/fan.msh out.msh --displacement in/fan.msh
morph in/fan.msh out.msh --displacement in/fold.npy
morph in/fan.msh out.msh --displacement in/nan.csv
morph in/fan.msh out.msh --displacement in/lifted.csv
morph in/inverted.msh out.msh --displacement in/still-inverted.csv
morph in/surface-sphere.vtk out.vtk --displacement in/fold.npy
smooth
smooth in/fan.msh
smooth in/fan.msh out.msh more.msh
smooth in/missing.msh no/out.vtk
smooth in/missing.msh out.vtk -d sideways
smooth in/missing.msh out.vtk --report r.txt
smooth in/fan.msh out.xyz
smooth in/fan.msh out
smooth in/fan.msh out.json --output-format vtk
smooth in/fan.msh in
smooth in/fan.msh in/fan.msh/out.vtk
smooth in/fan.msh out.msh --report no/r.json
smooth in/fan.msh out.msh --report in
smooth in/fan.msh out.msh --plot no/p.svg
smooth in/fan.msh out.msh --plot out.msh
smooth in/fan.msh /dev/full --output-format vtk --no-report
smooth in/plate_quads.msh out.stl
smooth in/hex_block.vtu out.off
smooth in/surface-sphere.vtk out.vtk --untangle
smooth in/curved.msh out.msh
smooth in/curved.msh out.msh --straighten
smooth in/curved.msh out.msh --debug
untangle in/fan.msh
untangle in/fan.msh out.msh --seed 1
untangle in/fan.msh out.msh --time-limit -1
untangle in/fan.msh out.msh --boundary project
untangle in/surface-sphere.vtk out.vtk
""".strip().splitlines()

WRONG_OPTIONS = """
-n | -n many | -n -1 | -n 1.5 | --tol -1e-3 | --tol nan | --tol inf | --tol small | --patience 0
--target 1.5 | --target nan | --time-limit -1 | --time-limit inf | --fail-below 30 | --order alphabetical
--boundary float | --feature-angle 181 | --feature-angle nan | --max-deviation -1 | --max-deviation inf
--seed -1 | --seed 18446744073709551616 | --center 1 | --center 1,2,3,4 | --center 1,x | --center nan,0
--axis 0,1 | --axis 0,0,inf | --axis 0,0,0 -d circumferential | -d sideways | -d random,sideways | -d ''
-d x, | -d z | -d field:flow | -d file:d.bin | -d file:d.npy | -d file:in/vertices.txt | -d file:in/nan.csv
--below 1.5 | --below 0.3 --layers -1 | --layers 1 | --fix wall | --only wall | --fix 99 | --vertices v.dat
--vertices v.txt | --vertices in/far.txt | --vertices in/nan.csv | --vertices in/fan.msh | --floor 1.1
--floor nan | --preset book | --preset paper -d x | --preset paper --order shuffled | --preset paper --polish
--preset paper --patches | --preset paper --tol 0.1 | --report r.txt | --report r | --report out.msh
--report r.json --no-report | --plot p.gif | --plot p | --quality-field | -q -v | --input-format cuneiform
--output-format cuneiform | --engine cuda | --threads 0 | --threads two | --input-format vtk
--only 1 --fix 1 | --center 0,0 | --vertices in/one.txt --only wall | -d x --debug --fix wall
""".replace("\n", "|").split("|")

ARRAYS = """
smooth in/random_square.msh out.msh -d file:in/square-directions.npy --engine numpy
smooth in/random_square.msh out.msh -d file:in/square-directions.csv,random --engine numba
smooth in/random_square.msh out.msh -d file:in/square-directions.txt --engine numpy
smooth in/random_square.msh out.msh -d file:in/square-many.npy --engine numpy -v
smooth in/field.vtk out.vtk -d field:flow --engine numpy
smooth in/field.vtk out.vtk -d field:flow,steepest --engine numba
smooth in/field.vtk out.vtk -d field:height
smooth in/two_materials.msh out.msh --only steel --engine numpy --no-patches -n 5
smooth in/two_materials.msh out.msh --only steel --engine numba
smooth in/two_materials.msh out.msh --only brass --fix crack --boundary slide --engine numba
smooth in/two_materials.msh out.msh --fix clamped --fix loaded --boundary slide --engine numpy --no-patches -n 4
smooth in/two_materials.msh out.msh --fix interface --boundary project --engine numba
smooth in/two_materials.msh out.msh --only 1 --only 2 -n 3 --engine numpy --no-patches
smooth in/plate_quads.msh out.msh --fix hole --boundary project --engine numba
smooth in/plate_quads.msh out.msh --fix outer --boundary slide --engine numpy --no-patches
smooth in/panel.obj out.obj --only left --engine numpy
smooth in/panel.obj out.obj --fix right --engine numba
smooth in/random_square.msh out.msh --fix boundary --boundary slide -n 5 --engine numpy
smooth in/random_square.msh out.msh --fix square
smooth in/random_square.msh out.msh --vertices in/vertices.csv --engine numpy -v
smooth in/random_square.msh out.msh --vertices in/one.txt --below 0.5 --layers 1
smooth in/surface-sphere.vtk out.vtk --engine numba -n 20
smooth in/surface-sphere.vtk out.vtk --engine numpy --no-patches -n 4
smooth in/part-slit.msh out.msh --boundary slide --engine numpy --no-patches -n 6
smooth in/tangled-tetra.vtk out.vtk --untangle --boundary slide --engine numba
smooth in/tangled-triangle.vtk out.vtk --untangle --engine numpy --no-patches -n 2
morph in/hexagon.vtk out.vtk --displacement in/turn.npy -d axis
morph in/hexagon.vtk out.vtk --displacement in/turn.npy -d axis --engine numba -v
morph in/hexagon.vtk out.vtk --displacement in/turn.csv -d random --seed 4 --engine numpy
morph in/hexagon.vtk out.msh --displacement in/turn.txt -d steepest --engine numpy -n 10
morph in/hexagon.vtk out.vtk --displacement in/turn.npy -d optimal --engine numba -n 5 --order natural
morph in/hexagon.vtk out.vtk --displacement in/far-turn.npy -d axis
morph in/hexagon.vtk out.vtk --displacement in/pull.npy --near 2
morph in/hexagon.vtk out.vtk --displacement in/pull.npy --near 0 --fail-below 0.99
morph in/hexagon.vtk out.vtu --displacement in/pull.npy --quality-field --report r.csv -q
morph in/hexagon.vtk out.vtk --displacement in/turn.npy --target 0.6 --tol 1e-5 --patience 2 --no-report
morph in/random_cube.vtk out.vtk --displacement in/bend.npy -d axis --engine numpy
morph in/random_cube.vtk out.vtk --displacement in/bend.npy --engine numba --threads 2 --order shuffled
morph in/random_cube.vtk out.vtk --displacement in/bend.npy --near 1 --engine numba -d circumferential --axis 1,0,0
morph in/two_materials.msh out.msh --displacement in/bend-materials.npy --engine numba
morph in/mixed_solid.vtu out.vtu --displacement in/bend-solid.npy --engine numpy -n 10
morph in/mixed_solid.vtu out.vtk --displacement in/bend-solid.npy --engine numba
morph in/part-cube-2.msh out.msh --displacement in/bend-second.npy --engine numpy
morph in/part-cube-2.msh out.msh --displacement in/bend-second.npy --engine numba --straighten
morph in/fan.msh out.msh --displacement in/stretch.csv -d axis --plot p.svg
untangle in/inverted.msh out.msh --report r.csv
untangle in/inverted.msh out.msh --fix 1
untangle in/inverted.msh out.vtu --quality-field --boundary slide
untangle in/inverted.msh out.msh --plot p.svg --report r.html
untangle in/inverted.msh out.msh --fail-below 0 -q --no-report
untangle in/inverted.msh out.vtk --output-format vtk --input-format gmsh --straighten --time-limit 1000
""".strip().splitlines()

PIPES = """
smooth - out.msh --engine numpy --no-patches -n 3 < in/random_square.msh
smooth - - --engine numpy --no-patches -n 3 < in/random_square.msh
smooth - - --engine numpy --no-patches -n 3 < in/two_materials.msh
smooth - - --engine numpy --no-patches -n 3 < in/random_cube.vtk
smooth - - --engine numpy --no-patches -n 3 < in/hex_block.vtu
smooth - - --engine numpy --no-patches -n 3 < in/panel.obj
smooth - - --engine numpy --no-patches -n 3 --output-format vtk -q < in/panel.obj
smooth - - --engine numpy --no-patches -n 3 --input-format medit --output-format medit < in/read-medit.mesh
smooth - - --engine numpy --no-patches -n 3 --report r.json --quality-field --output-format vtu < in/mixed_plane.vtk
smooth - - --engine numba < in/negative_ball.msh
smooth - - < in/bad/empty/empty.msh
smooth - - < in/bad/a_text_that_is_no_mesh/letter.msh
smooth - - < in/bad/gmsh_cut_in_its_nodes/cut.msh
smooth in/random_square.msh - -n 2 --engine numpy
smooth in/random_square.msh - -n 2 --engine numpy --output-format obj
smooth in/random_square.msh - -n 2 --engine numpy --output-format xdmf
smooth in/mixed_solid.vtu - -n 2 --engine numpy --no-patches -q
untangle - - < in/inverted.msh
morph - - --displacement in/turn.npy -d axis < in/hexagon.vtk
report quality - < in/random_square.msh
report quality - --json < in/random_cube.vtk
report quality - --csv --input-format vtk < in/random_cube.vtk
report compare - in/random_square.msh < in/random_square.msh
cp in/random_square.msh a.msh ; smooth a.msh a.msh --engine numpy -n 3
cp in/hex_block.vtu a.vtu ; smooth a.vtu a.vtu --engine numpy -n 3 --quality-field --no-patches
cp in/two_materials.msh a.msh ; smooth a.msh a.msh -n 2 ; report compare in/two_materials.msh a.msh --json
""".strip().splitlines()

PICTURES = """
smooth in/random_square.msh out.msh -n 4 --engine numpy --no-patches --plot p.svg
smooth in/random_square.msh out.msh -n 4 --engine numpy --no-patches --plot p.png
smooth in/random_square.msh out.msh -n 4 --engine numpy --no-patches --report r.html
smooth in/two_materials.msh out.msh --engine numba --plot p.svg --report r.html
smooth in/mixed_plane.vtk out.vtk -n 4 --engine numpy --no-patches --plot p.html -v
smooth in/mixed_solid.vtu out.vtu -n 4 --engine numpy --no-patches --plot p.svg
smooth in/surface-sphere.vtk out.vtk -n 4 --engine numba --plot p.svg
report quality in/random_square.msh --plot p.svg
report quality in/two_materials.msh --plot p.html
report quality in/panel.obj --plot p.png --json
report compare in/random_square.msh in/random_square-1.msh --plot p.svg
report compare in/random_cube.vtk in/random_cube-1.vtk in/random_cube-2.vtk --plot p.html
""".strip().splitlines()

TERMINAL = """
tty report quality in/random_square.msh
tty report quality in/two_materials.msh --worst 3
tty report quality in/tangled-tetra.vtk
tty report quality in/surface-sphere.vtk
tty report compare in/random_square.msh in/random_square-1.msh
tty report compare in/random_square-1.msh in/random_square.msh
tty report compare in/random_square.msh in/random_square.msh
tty report compare in/random_cube.vtk in/random_cube-1.vtk in/random_cube-2.vtk
tty report quality in/fan.msh --json
tty smooth in/random_square.msh out.msh -n 5 --engine numpy --no-patches
tty smooth in/random_cube.vtk out.vtk --boundary project --engine numba
tty smooth in/two_materials.msh out.vtu -n 2 -v
tty untangle in/inverted.msh out.msh
tty morph in/hexagon.vtk out.vtk --displacement in/turn.npy -d axis
tty smooth in/missing.msh out.msh
tty smooth --frobnicate
tty smooth --help
""".strip().splitlines()

SMALL = """
--version
smooth --help
morph --help
untangle --help
report quality --help
report compare --help
smooth in/random_square.msh out.msh -v
smooth in/random_square.msh out.msh --engine numpy --no-polish -n 3 --patches -q
smooth in/random_cube.vtk out.vtk --engine numba --threads 2 --patches --polish --floor 0.9
smooth in/random_cube.vtk out.vtk --engine numpy --no-patches
smooth in/random_square.msh out.msh -d optimal -n 4 --engine numba
smooth in/hex_block.vtu out.vtu --quality-field -n 2 --engine numpy --no-patches
smooth in/mixed_solid.vtu out.vtu --engine numba --threads 1
smooth in/mixed_solid.vtu out.vtu -d circumferential,radial --axis 1,1,0 --center 0.5,0.5,0.5 -n 5 --engine numpy
smooth in/mixed_plane.vtk out.vtk -d optimal -n 2 --engine numpy
smooth in/mixed_plane.vtk out.vtk --boundary slide --engine numpy --no-patches
smooth in/negative_ball.msh out.msh --order shuffled --seed 3 -n 5 --engine numpy --no-patches
smooth in/hexagon.vtk out.vtk -d circumferential -n 6 --engine numpy
smooth in/plate_quads.msh out.msh --preset paper -n 5 --engine numpy
smooth in/plate_quads.msh out.msh --boundary project -n 4 --engine numpy --no-patches
smooth in/two_materials.msh out.msh --boundary project --engine numba
smooth in/two_materials.msh out.msh --only brass --fix crack --boundary slide --engine numba
smooth in/random_square.msh out.msh --below 0.3 --layers 1 --engine numpy --no-patches
smooth in/random_square.msh out.msh --vertices in/vertices.txt --engine numpy --no-patches
smooth in/random_square.msh out.msh -d file:in/square-many.npy --engine numpy -v
smooth in/field.vtk out.vtk -d field:flow --engine numpy
smooth in/panel.obj out.obj --only left --engine numpy
smooth in/panel.obj out.vtk -n 2 --engine numpy --no-patches
smooth in/two_materials.msh out.vtu -n 2 --engine numpy --no-patches
smooth in/random_square.msh out.obj -n 2 --engine numpy --no-patches
smooth in/random_cube.vtk out.inp -n 2 --engine numpy --no-patches
smooth in/surface-sphere.vtk out.vtk --engine numba -n 20
smooth in/surface-sphere.vtk out.vtk --engine numpy --no-patches -n 4
smooth in/part-slit.msh out.msh --boundary slide --engine numpy --no-patches -n 6
smooth in/part-plate-quads-2.msh out.msh --straighten --engine numpy -n 2 --no-patches
smooth in/curved.msh out.msh
smooth in/curved.msh out.msh --straighten
smooth in/tangled-tetra.vtk out.vtk --untangle --boundary slide --engine numba
smooth in/tangled-triangle.vtk out.vtk --untangle --engine numpy --no-patches -n 2
smooth in/read-tetgen.node out.node --engine numpy --no-patches -n 3
smooth in/random_square.msh out.msh -n 4 --engine numpy --no-patches --report r.html
smooth in/fan.msh out.msh --layers 1
smooth in/fan.msh out.msh -d sideways
smooth in/bad/repeated_vertex/twice.msh out.vtk
smooth - - --engine numpy --no-patches -n 3 < in/two_materials.msh
untangle in/inverted.msh out.msh --fix 1
untangle in/tangled-quad.vtk out.vtk --boundary slide
morph in/hexagon.vtk out.vtk --displacement in/turn.npy -d axis
morph in/random_cube.vtk out.vtk --displacement in/bend.npy --engine numba --threads 2 --order shuffled
report quality in/two_materials.msh
report quality in/mixed_solid.vtu --json
report quality in/random_cube.vtk --csv
report compare in/random_square-1.msh in/random_square.msh --json
tty report compare in/random_cube.vtk in/random_cube-1.vtk in/random_cube-2.vtk
tty smooth in/random_square.msh out.msh -n 5 --engine numpy --no-patches
api smooth
api relaxer
api reports
api errors
api gmsh 5/25
api vtk 5/25
api damaged 5/25
""".strip().splitlines()


def commands(small: bool) -> list[str]:
    """All command lines, each once, or the small choice of them."""
    full = list(dict.fromkeys(line.strip() for line in _all()))
    if unknown := set(SMALL) - set(full):
        sys.exit("not among the commands: " + "; ".join(sorted(unknown)))
    return [line for line in full if line in set(SMALL)] if small else full


def _all() -> Iterator[str]:
    yield from ("", "--help", "-h", "--version", "--version smooth")
    for command in ("smooth", "untangle", "morph", "report", "report quality", "report compare"):
        yield f"{command} --help"
    yield from (line for line in WRONG)
    yield from (f"smooth in/fan.msh out.msh {options.strip()}" for options in WRONG_OPTIONS)
    for path in BAD:
        bad = f"in/bad/{path}"
        yield f"smooth {bad} out.vtk"
        yield f"report quality {bad}"
        yield f"report compare {bad} {bad}"
        yield f"untangle {bad} out.msh --debug"
    for name in SAMPLES:
        suffix = Path(name).suffix
        for options in [*ON_SAMPLES, *(ON_VOLUMES if name in VOLUMES else [])]:
            yield f"smooth in/{name} out{suffix} {options}"
        yield f"smooth in/{name} out.vtu --quality-field -n 2 --engine numpy --no-patches"
        yield f"untangle in/{name} out{suffix}"
        stem = Path(name).stem
        yield from _reports(name)
        yield f"report compare in/{name} in/{stem}-1{suffix}"
        yield f"report compare in/{stem}-1{suffix} in/{name} --json"
        yield f"report compare in/{name} in/{stem}-1{suffix} in/{stem}-2{suffix}"
        yield f"report compare in/{name} in/{stem}-2{suffix} in/{name} --json"
        yield f"report compare in/{name} in/{name}"
        for written in WRITTEN:
            yield f"smooth in/{name} out.{written} -n 2 --engine numpy --no-patches"
    for i, name in enumerate(OTHERS):  # each of the benchmarks has all options, of the rest each a third
        suffix = Path(name).suffix
        for options in ON_OTHERS if name.startswith("bench") else ON_OTHERS[i % 3 :: 3]:
            yield f"smooth in/{name} out{suffix} {options}"
        yield f"untangle in/{name} out{suffix}"
        yield f"untangle in/{name} out{suffix} --boundary slide"
        yield f"smooth in/{name} out{suffix} --straighten --engine numpy -n 2 --no-patches"
        yield f"report quality in/{name}"
        yield f"report quality in/{name} --json"
    for name in READ:
        path = f"read-{name}.{SUFFIX.get(name, name)}"
        suffix = Path(path).suffix
        yield f"smooth in/{path} out{suffix} --engine numpy --no-patches -n 3"
        yield f"smooth in/{path} out.vtk --engine numpy --no-patches -n 3"
        yield f"smooth in/{path} out.msh --engine numpy --no-patches -n 3"
        yield f"smooth in/{path} out.vtu --engine numpy --no-patches -n 3 --quality-field"
        yield f"report quality in/{path} --json"
    yield from ("smooth in/bench.msh out.msh", "smooth in/bench.msh out.msh --engine numba --threads 1")
    yield "smooth in/bench.msh out.msh --boundary project --engine numba -n 6"
    yield from (*ARRAYS, *PIPES, *PICTURES, *TERMINAL)
    yield from (f"api {name}" for name in ("smooth", "relaxer", "reports", "errors"))
    for name in ("gmsh", "vtk", "damaged"):
        yield from (f"api {name} {k}/{n}" for k, n in [(5, 25), *((k, 16) for k in range(16))])


def _reports(name: str) -> Iterator[str]:
    for options in ("", "--json", "--csv", "--worst 0", "--worst 3 --json", "--fail-below 0.9", "--debug"):
        yield f"report quality in/{name} {options}"


# ------------------------------------------------------------------------------- calls of the Python interface


def api_smooth() -> None:
    """Points of arrays and of meshio meshes."""
    import dvr_cli

    for name in ("random_square.msh", "mixed_plane.vtk", "random_cube.vtk", "mixed_solid.vtu"):
        mesh = _read(name)
        cells = [(block.type, block.data) for block in mesh.cells if block.type not in ("line", "vertex")]
        for options in (
            {"max_iterations": 3, "patches": False},
            {"directions": "axis", "order": "natural", "engine": "numba", "threads": 2},
            {
                "directions": ["random", "x"],
                "seed": 5,
                "boundary": "slide",
                "engine": "numpy",
                "max_iterations": 9,
            },
            {"below": 0.4, "layers": 1, "polish": True, "max_iterations": 2, "patches": False},
            {"vertices": [20, 21, 22, 23], "engine": "numpy", "patches": False},
        ):
            _show(name, options, *dvr_cli.smooth(mesh.points, cells, **options))
        moved, report = dvr_cli.smooth(mesh, max_iterations=2, patches=False)
        _show(name, "meshio", moved.points, report)
    mesh = _read("tangled-tetra.vtk")
    points, cells = (
        _read("random_square.msh").points,
        {"triangle": _read("random_square.msh").cells_dict["triangle"]},
    )
    _show("patches", "", *dvr_cli.smooth(points, cells, max_iterations=2, patches=True, engine="numpy"))
    _show("untangle", "", *dvr_cli.untangle(mesh.points, {"tetra": mesh.cells[0].data}, boundary="slide"))


def api_relaxer() -> None:
    """A boundary that moves in five steps, in two dimensions and in three."""
    import numpy as np

    import dvr_cli

    for name, kind, d in (("hexagon.vtk", "triangle", 2), ("random_cube.vtk", "tetra", 3)):
        mesh = _read(name)
        points = mesh.points[:, :d]
        for options in (
            {},
            {"directions": "axis", "engine": "numpy", "order": "natural"},
            {"directions": "optimal", "engine": "numba", "threads": 2, "max_iterations": 4},
        ):
            relaxer = dvr_cli.Relaxer(points, {kind: mesh.cells_dict[kind]}, **options)
            _show(name, options, relaxer.held.astype(float), None)
            for step in range(5):
                shift = 0.02 * np.sin(step + relaxer.points[:, [1, 0, *range(2, d)]])
                near = 2 if step == 3 else None
                moved, report = relaxer.relax(displacement=shift, near=near)
                _show(name, step, moved, None)
                print(report.q1_before, report.q1_after, report.relaxed, report.stopped_because)
                print([(sweep.sweep, sweep.q1, sweep.moved) for sweep in report.sweeps])
            moved, _ = relaxer.relax(relaxer.points + 1e-3 * np.sin(relaxer.points))
            _show(name, "points", moved, None)


def api_reports() -> None:
    """Qualities and comparisons of the samples."""
    import dvr_cli

    for name in SAMPLES:
        if name.endswith(".obj"):
            continue
        stem, suffix = Path(name).stem, Path(name).suffix
        before, after, last = _read(name), _read(f"{stem}-1{suffix}"), _read(f"{stem}-2{suffix}")
        report = dvr_cli.quality_report(before, worst=4)
        print(name, _record(report.record(name)))
        ranking = dvr_cli.compare(before, after, last)
        print(ranking.better, ranking.component, list(ranking.ranks))
        print(_record(ranking.record(["a", "b", "c"])))


def api_errors() -> None:
    """Wrong calls: the kind of error and its words."""
    import numpy as np

    import dvr_cli

    mesh = _read("random_square.msh")
    points, cells = mesh.points, {"triangle": mesh.cells_dict["triangle"]}
    flat = {"triangle": np.array([[0, 1, 1]])}
    for call in (
        lambda: dvr_cli.smooth(points, cells, directions="sideways"),
        lambda: dvr_cli.smooth(points, cells, engine="cuda"),
        lambda: dvr_cli.smooth(points, cells, threads=0, engine="numba"),
        lambda: dvr_cli.smooth(points, cells, order="alphabetical"),
        lambda: dvr_cli.smooth(points, cells, boundary="float"),
        lambda: dvr_cli.smooth(points, cells, preset="book"),
        lambda: dvr_cli.smooth(points, cells, preset="paper", directions="x"),
        lambda: dvr_cli.smooth(points, cells, max_iterations=-1),
        lambda: dvr_cli.smooth(points, cells, tol=float("nan")),
        lambda: dvr_cli.smooth(points, cells, patience=0),
        lambda: dvr_cli.smooth(points, cells, target=2.0),
        lambda: dvr_cli.smooth(points, cells, time_limit=-1.0),
        lambda: dvr_cli.smooth(points, cells, floor=1.5),
        lambda: dvr_cli.smooth(points, cells, seed=-1),
        lambda: dvr_cli.smooth(points, cells, layers=2),
        lambda: dvr_cli.smooth(points, cells, below=3.0),
        lambda: dvr_cli.smooth(points, cells, vertices=[5000]),
        lambda: dvr_cli.smooth(points, cells, vertices=[0.5]),
        lambda: dvr_cli.smooth(points, cells, fix="wall"),
        lambda: dvr_cli.smooth(points, cells, center=(1.0,)),
        lambda: dvr_cli.smooth(points, cells, axis=(0, 0, 0), directions="circumferential"),
        lambda: dvr_cli.smooth(points, cells, directions=np.ones((3, 2))),
        lambda: dvr_cli.smooth(points, cells, feature_angle=200.0),
        lambda: dvr_cli.smooth(points, cells, max_deviation=-1.0, boundary="project"),
        lambda: dvr_cli.smooth(points, flat),
        lambda: dvr_cli.smooth(points, {"triangle": np.array([[0, 1, 999]])}),
        lambda: dvr_cli.smooth(points, {"polygon": np.array([[0, 1, 2]])}),
        lambda: dvr_cli.smooth(points, {"line": np.array([[0, 1]])}),
        lambda: dvr_cli.smooth(points),
        lambda: dvr_cli.smooth(points[:, :1], cells),
        lambda: dvr_cli.smooth(np.full_like(points, np.nan), cells),
        lambda: dvr_cli.untangle(points, cells, boundary="project"),
        lambda: dvr_cli.quality_report(points, {"line": np.array([[0, 1]])}),
        lambda: dvr_cli.compare(mesh),
        lambda: dvr_cli.compare(mesh, _read("hexagon.vtk")),
        lambda: dvr_cli.Relaxer(points, cells).relax(displacement=np.ones((3, 2))),
        lambda: dvr_cli.Relaxer(points, cells).relax(displacement=np.full_like(points, np.nan)),
        lambda: dvr_cli.Relaxer(points, cells).relax(near=-1, displacement=np.zeros_like(points)),
        lambda: dvr_cli.Relaxer(_read("surface-sphere.vtk")),
        lambda: dvr_cli.nothing,
    ):
        try:
            call()
            print("done")
        except Exception as error:
            print(type(error).__name__, error)


def api_gmsh(part: str) -> None:
    """Files of the corpus of Gmsh: measured, relaxed in place, converted."""
    _files(part, "corpus-gmsh", "msh", "vtk", "vtu")


def api_vtk(part: str) -> None:
    """Files of the corpus of VTK: measured, relaxed in place, converted."""
    _files(part, "corpus-vtk", "vtk", "msh", "vtu")


def api_damaged(part: str) -> None:
    """Files with bytes changed or left out: what is said of each."""
    for path in _part(part, "damaged"):
        _dvr("smooth", str(path), f"out{path.suffix}", "-n", "1", "--no-report", "--engine", "numpy")


def _part(part: str, folder: str) -> list[Path]:
    """The files of part K/N of a folder: every Nth from the Kth on."""
    k, n = map(int, part.split("/"))
    return sorted(Path("in", folder).iterdir())[k::n]


def _files(part: str, folder: str, same: str, *others: str) -> None:
    few = ["-n", "2", "--engine", "numpy", "--no-patches"]
    for path in _part(part, folder):
        _dvr("report", "quality", str(path), "--json")
        for suffix in (same, *others):
            _dvr("smooth", str(path), f"out.{suffix}", *few, "--straighten")
        _dvr("smooth", str(path), f"out.{same}", *few, "--boundary", "slide", "-q")


def _dvr(*arguments: str) -> None:
    """Run ``dvr`` in this process, as there are many to run; show what it wrote by its digest, and remove it."""
    print("$", *arguments, flush=True)
    print(f"exit {run_dvr(list(arguments))}", flush=True)
    for path in sorted(Path().rglob("out*")):
        content = path.read_bytes()
        if path.suffix == ".json":
            content = json.dumps(_plain(json.loads(content))).encode()
        print(path, len(content), hashlib.sha256(content).hexdigest(), flush=True)
        path.unlink()


def _read(name: str) -> Any:
    import meshio

    return meshio.read(f"in/{name}", file_format="gmsh" if name.endswith(".msh") else None)


def _show(name: str, options: Any, points: Any, report: Any) -> None:
    print(name, options, points.shape, points.dtype, hashlib.sha256(points.tobytes()).hexdigest())
    if report is not None:
        print(_record(report.record("out", "in")))


def _record(record: Any) -> str:
    return json.dumps(_plain(record), default=str)


# ------------------------------------------------------------------------------------------------- inputs


def make_inputs(reference: Path, folder: Path) -> None:
    """Write all inputs into a folder; runs with the reference's package, tests and benchmarks in the path."""
    import contextlib
    import importlib.util

    import meshio
    import numpy as np

    import curved_parts
    import gmsh_corpus
    import gmsh_parts
    import meshes
    import test_cli_bad_input
    import vtk_corpus
    from cli_support import fan, write

    def save(path: str, mesh: Any, **data: Any) -> None:
        points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1])))
        cells = [(block.type, np.asarray(block.vertices)) for block in mesh.cells]
        meshio.write(folder / path, meshio.Mesh(points, cells, **data), file_format="vtk42", binary=True)

    for name in SAMPLES:
        shutil.copy(reference / "sample_meshes" / name, folder / name)
        path = folder / name
        for i, options in enumerate((["-n", "1"], ["-n", "4", "-d", "random"]), start=1):
            better = folder / f"{path.stem}-{i}{path.suffix}"
            arguments = ["smooth", path, better, "-q", "--no-report", "--engine", "numpy", *options]
            subprocess.run([sys.executable, "-m", "dvr_cli", *map(str, arguments)], check=True)

    spec = importlib.util.spec_from_file_location("bench_meshes", reference / "benchmarks" / "meshes.py")
    bench = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench)
    sizes = [300, 300, 300, 300, 5, 0.5, 8.0]
    for name, size in zip(BENCHMARKS, sizes, strict=True):
        save(f"bench-{name}.vtk", getattr(bench, name)(size))
    bench.write_msh(bench.random_tets(2000), folder / "bench.msh")

    for kind in KINDS:
        save(f"random-{kind}.vtk", meshes.random_mesh(kind, 3, n=4))
    for kind in BOXES:
        save(f"tangled-{kind}.vtk", meshes.tangled(kind, 6 if kind in ("triangle", "quad") else 4, 0.8, 1))
        save(f"bump-{kind}.vtk", meshes.bump(kind, 8 if kind in ("triangle", "quad") else 5))
    save("turned.vtk", meshes.turned_hexagon(6, 60))
    for name in CURVED:
        save(f"solid-{name}.vtk", curved_parts.solid(name))
        save(f"surface-{name}.vtk", curved_parts.surface(name))
    save("scanned.vtk", curved_parts.scanned())
    for name in PARTS:
        _make_part(gmsh_parts, name, folder / f"part-{name}.msh")
    for name in gmsh_corpus.NAMES:
        (folder / "corpus-gmsh").mkdir(exist_ok=True)
        (folder / "corpus-gmsh" / f"{name}.msh").write_bytes(gmsh_corpus.corpus(name))
    (folder / "corpus-vtk").mkdir()
    for name, content in vtk_corpus.corpus().items():
        (folder / "corpus-vtk" / f"{name}.vtk").write_bytes(content)

    tags = [np.ones(4, dtype=int)]
    fan(folder / "fan.msh", cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})
    fan(folder / "inverted.msh", 1.5, 0.9, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})
    curved = [[0, 0], [1, 0], [0, 1], [0.5, -0.2], [0.5, 0.5], [0, 0.5]]
    write(folder / "curved.msh", curved, {"triangle6": [[0, 1, 2, 3, 4, 5]]})
    for name, make in test_cli_bad_input.INPUTS.items():
        (folder / "bad" / name).mkdir(parents=True)
        make(folder / "bad" / name)
    _make_arrays(folder)

    rng = np.random.default_rng(11)
    (folder / "damaged").mkdir()
    sources = [*(folder / "corpus-gmsh").iterdir(), *(folder / "corpus-vtk").iterdir()]
    sources += [folder / name for name in ("panel.obj", "hex_block.vtu", "fan.msh")] * 10
    for i, path in enumerate(sorted(sources)):
        data = bytearray(path.read_bytes())
        if i % 3 == 0:
            del data[int(rng.integers(len(data))) :]
        elif i % 3 == 1:
            for place in rng.integers(len(data), size=3):
                data[place] = rng.integers(256)
        else:
            start = int(rng.integers(len(data)))
            del data[start : start + int(rng.integers(1, 40))]
        (folder / "damaged" / f"{i:03d}-{path.name}").write_bytes(data)

    cube = meshio.read(folder / "random_cube.vtk")
    flow = np.column_stack([cube.points[:, 1], -cube.points[:, 0], np.ones(len(cube.points))])
    data = {"flow": flow, "height": cube.points[:, 2]}
    meshio.write(folder / "field.vtk", meshio.Mesh(cube.points, cube.cells, point_data=data), "vtk42")
    plain = meshio.Mesh(cube.points, [("tetra", cube.cells_dict["tetra"])])
    flat = meshio.read(folder / "hexagon.vtk")
    surface = meshio.Mesh(flat.points, [("triangle", flat.cells_dict["triangle"])])
    for name in READ:
        mesh = surface if name in ("obj", "off", "ply", "stl", "su2") else plain
        with contextlib.suppress(Exception, SystemExit):  # what meshio cannot write is a missing input
            meshio.write(folder / f"read-{name}.{SUFFIX.get(name, name)}", mesh, file_format=name)


def _make_part(parts: Any, name: str, path: Path) -> None:
    """A part of the tests as Gmsh saves it: its groups, second order and quadrilaterals if its name says so."""
    import gmsh

    second, quads = name.endswith("-2"), "-quads" in name
    key = name.removesuffix("-2").removesuffix("-quads")
    build, dimension, size, opening = parts.PARTS.get(key, (None, 3, 0.5, None))
    gmsh.initialize(["gmsh"], readConfigFiles=False, interruptible=False)
    try:
        options = {"General.Terminal": 0, "General.NumThreads": 1, "Mesh.RecombineAll": int(quads)}
        options |= {"Mesh.MeshSizeMin": size, "Mesh.MeshSizeMax": size, "Mesh.RandomSeed": 1}
        for option, value in options.items():
            gmsh.option.setNumber(option, value)
        if build is None:
            gmsh.model.occ.addSphere(0, 0, 0, 1)
            gmsh.model.occ.synchronize()
        else:
            build(gmsh.model)
        gmsh.model.mesh.generate(dimension)
        gmsh.model.mesh.setOrder(2 if second else 1)
        if opening is not None:
            for option, value in {"Dimension": dimension - 1, "PhysicalGroup": 2}.items():
                gmsh.plugin.setNumber("Crack", option, value)
            gmsh.plugin.setNumber("Crack", "OpenBoundaryPhysicalGroup", opening)
            gmsh.plugin.run("Crack")
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def _make_arrays(folder: Path) -> None:
    """Directions, displacements and lists of vertices."""
    import meshio
    import numpy as np

    def points(name: str) -> Any:
        return meshio.read(folder / name, file_format="gmsh" if name.endswith(".msh") else None).points

    def text(name: str, array: Any, form: str = "%.17g") -> None:
        np.savetxt(folder / name, array, delimiter="," if name.endswith(".csv") else " ", fmt=form)

    rng = np.random.default_rng(12)
    some = np.arange(20, 60)
    np.save(folder / "vertices.npy", some)
    text("vertices.txt", some, "%d")
    text("vertices.csv", some, "%d")
    text("far.txt", [100000], "%d")
    text("one.txt", [4], "%d")
    square = rng.normal(size=(3, 99, 2))
    np.save(folder / "square-many.npy", square)
    np.save(folder / "square-directions.npy", square[0])
    text("square-directions.csv", square[1])
    text("square-directions.txt", np.pad(square[2], ((0, 0), (0, 1))))

    hexagon = points("hexagon.vtk")
    turned = {"turn": 30, "far-turn": 100}
    for name, degrees in turned.items():
        cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        shift = hexagon @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]) - hexagon
        np.save(folder / f"{name}.npy", shift)
        text(f"{name}.csv", shift)
        text(f"{name}.txt", shift[:, :2])
    pull = np.zeros_like(hexagon)
    pull[hexagon[:, 0].argmax(), 0] = 0.5
    np.save(folder / "pull.npy", pull)
    bent = {"bend": "random_cube.vtk", "bend-materials": "two_materials.msh", "bend-solid": "mixed_solid.vtu"}
    for name, mesh in {**bent, "bend-second": "part-cube-2.msh"}.items():
        x = points(mesh) / np.ptp(points(mesh))
        np.save(folder / f"{name}.npy", 0.1 * np.ptp(points(mesh)) * x[:, [1, 2, 0]] ** 2)
    text("stretch.csv", [[0, 0, 0], [0.5, 0, 0], [0.5, 0, 0], [0, 0, 0], [0, 0, 0]])
    text("nan.csv", np.full((5, 3), np.nan))
    text("lifted.csv", np.eye(5, 3))
    text("still-inverted.csv", np.zeros((5, 3)))
    np.save(folder / "fold.npy", np.array([[1.5, 0, 0], [0, 0, 0], [0, 0, 0], [1.5, 0, 0], [0, 0, 0]]))


# ------------------------------------------------------------------------------------------------- running

# What a process runs before those that it forks: they need not load the package and its kernels any more.
# In the small choice each starts without.
WARM = """
smooth in/random_square.msh out.msh --engine numba --threads 1 -n 3
smooth in/random_cube.vtk out.vtk --engine numba --threads 1 -n 3
smooth in/random_cube.vtk out.vtu --engine numpy --boundary project --quality-field --no-patches -n 1
report quality in/fan.msh --json
""".strip().splitlines()


def serve(reference: str) -> None:
    """Run the tasks that come as lines of JSON, each in a process forked from this one.

    What every command imports from elsewhere is imported before, which saves most of the time of small ones.
    The package itself is not, unless a task says that it is to run in this process: see WARM.
    """
    import importlib

    for name in ("meshio", "typer", "typer.main", "numba", "numpy.lib.recfunctions"):
        importlib.import_module(name)
    spec = importlib.util.find_spec("dvr_cli")
    if spec is None or Path(spec.origin or "").parent.parent != Path(reference):
        sys.exit(f"the package is not that of {reference}")
    replies = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin:
        task = json.loads(line)
        replies.write(f"{_here(**task) if task.pop('here') else _forked(**task)}\n")


def _here(arguments: list[str], folder: str, **_: Any) -> int:
    """Run one command in this process, whatever it says."""
    import contextlib

    os.chdir(folder)
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stderr(nowhere):
        return run_dvr(arguments)


def _forked(arguments: list[str], folder: str, feed: str | None, terminal: bool) -> int:
    """Run one command in a folder, its streams going to files beside it; returns its exit code."""
    streams = Path(folder).parent
    master, slave = pty.openpty() if terminal else (-1, -1)
    if terminal:
        import fcntl
        import termios

        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    child = os.fork()
    if not child:
        code = 70
        try:
            append = os.O_WRONLY | os.O_CREAT | os.O_APPEND
            os.chdir(folder)
            os.dup2(os.open(feed or os.devnull, os.O_RDONLY), 0)
            os.dup2(slave if terminal else os.open(streams / "stdout", append), 1)
            os.dup2(slave if terminal else os.open(streams / "stderr", append), 2)
            sys.stdin, sys.stdout = open(0), open(1, "w", encoding="utf-8")  # noqa: SIM115
            sys.stderr = open(2, "w", encoding="utf-8", buffering=1, errors="backslashreplace")  # noqa: SIM115
            if arguments[:1] == ["api"]:
                globals()[f"api_{arguments[1]}"](*arguments[2:])
                code = 0
            else:
                code = run_dvr(arguments)
            sys.stdout.flush()
            sys.stderr.flush()
        except BaseException:
            import traceback

            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)
    killer = threading.Timer(LIMIT, os.kill, (child, signal.SIGKILL))
    killer.start()
    if terminal:
        os.close(slave)
        with open(streams / "stdout", "ab") as file:
            try:
                while data := os.read(master, 1 << 16):
                    file.write(data)
            except OSError:  # the terminal is closed when the command has ended
                pass
        os.close(master)
    _, status = os.waitpid(child, 0)
    killer.cancel()
    return os.waitstatus_to_exitcode(status)


def run_dvr(arguments: list[str]) -> int:
    """``python -m dvr_cli ARGUMENTS`` in this process; returns the exit code."""
    import runpy

    sys.argv = ["dvr", *arguments]
    try:
        runpy.run_module("dvr_cli", run_name="__main__")
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


class Checkout:
    """A checkout, and the processes that run commands in it, one a thread."""

    def __init__(self, path: Path, warm: bool) -> None:
        """warm: whether its processes run WARM first."""
        self.path = path
        self._warm = warm
        self._local = threading.local()
        self._servers: list[subprocess.Popen[str]] = []

    def environment(self, *folders: str) -> dict[str, str]:
        """The environment in which the package is that of this checkout; folders: of its tests, in the path too."""
        path = os.pathsep.join([str(self.path), *(str(self.path / folder) for folder in folders)])
        kept = {key: value for key, value in os.environ.items() if not key.startswith("DVR")}
        fixed = {"PYTHONPATH": path, "PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1", "TERM": "xterm"}
        return {**kept, **fixed, "COLUMNS": "80", "SOURCE_DATE_EPOCH": "0", "PYTHONHASHSEED": "0"}

    def run(self, command: str, inputs: Path, result: Path) -> None:
        """Run a command; leaves ``code``, ``seconds``, ``stdout``, ``stderr``, ``files`` in the folder ``result``."""
        work = result.with_name(f"{result.name}.{os.getpid()}.{threading.get_ident()}")
        files = work / "files"
        files.mkdir(parents=True)
        (files / "in").symlink_to(inputs)
        codes, begin = [], time.time()
        for part in command.split(" ; "):
            words, feed = shlex.split(part), None
            if "<" in words:
                words, (_, feed) = words[:-2], words[-2:]
            if words[:1] == ["cp"]:
                shutil.copy(files / words[1], files / words[2])
                continue
            terminal = words[:1] == ["tty"]
            task = {"arguments": words[terminal:], "folder": str(files), "feed": feed, "terminal": terminal}
            codes.append(self._asked({**task, "here": False}, inputs))
        (files / "in").unlink()
        (work / "code").write_text(" ".join(map(str, codes)))
        (work / "seconds").write_text(f"{time.time() - begin:.2f}")
        try:
            work.replace(result)
        except OSError:  # another comparison has it by now
            shutil.rmtree(work)

    def _asked(self, task: dict[str, Any], inputs: Path) -> int:
        """The exit code of a task, run by the process of this thread."""
        if not hasattr(self._local, "server"):
            self._local.server = subprocess.Popen(
                [sys.executable, str(Path(__file__).resolve()), "--serve", str(self.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=self.environment(),
            )
            self._servers.append(self._local.server)
            with tempfile.TemporaryDirectory() as folder:
                Path(folder, "in").symlink_to(inputs)
                for command in WARM if self._warm else ():
                    self._answer({"arguments": command.split(), "folder": folder, "here": True})
        return self._answer(task)

    def _answer(self, task: dict[str, Any]) -> int:
        server = self._local.server
        server.stdin.write(json.dumps(task) + "\n")
        server.stdin.flush()
        reply = server.stdout.readline()
        if not reply:
            sys.exit(f"the process that runs commands in {self.path} has ended")
        return int(reply)

    def close(self) -> None:
        """End the processes."""
        for server in self._servers:
            server.stdin.close()
            server.wait()

    def commit(self) -> str | None:
        """The commit it is at, None if files differ from it."""
        git = ["git", "-C", str(self.path)]
        if subprocess.run([*git, "diff", "--quiet", "HEAD"]).returncode:
            return None
        return subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True).stdout.strip()


def inputs_of(reference: Checkout, cache: Path) -> Path:
    """The folder of the inputs, made if need be."""
    made_by = "".join(inspect.getsource(make) for make in (make_inputs, _make_part, _make_arrays))
    folder = cache / f"inputs-{_digest(made_by, *SAMPLES, *READ, *PARTS)}"
    if not folder.exists():
        print("making the inputs", file=sys.stderr)
        part = cache / f"{folder.name}.{os.getpid()}"
        part.mkdir(parents=True)
        command = [sys.executable, str(Path(__file__).resolve()), "--make", str(part), str(reference.path)]
        environment = reference.environment("tests", "tests/cli", "tests/files")
        made = subprocess.run(command, env=environment, stderr=subprocess.PIPE)
        if made.returncode:
            sys.exit(f"the inputs could not be made:\n{made.stderr.decode()}")
        part.replace(folder)
    return folder


def place_of(command: str, results: Path, inputs: Path) -> Path:
    """The folder of a command's outputs."""
    source = ""
    if command.startswith("api "):
        helpers = (_part, _files, _dvr, _read, _show, _record, _plain)
        own = globals()[f"api_{command.split()[1]}"]
        source = "".join(inspect.getsource(function) for function in (own, *helpers))
    name = re.sub(r"[^A-Za-z0-9.]+", "-", command)[:80]
    return results / f"{name}-{_digest(command, source, inputs.name)}"


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:12]


# ------------------------------------------------------------------------------------------------ comparing


def differences(old: Path, new: Path, checkouts: tuple[Path, Path]) -> Iterator[str]:
    """What differs between the outputs of a command in two folders, a line each."""
    codes = [(folder / "code").read_text() for folder in (old, new)]
    if codes[0] != codes[1]:
        yield f"exit code {codes[0]} | {codes[1]}"
    for stream in ("stdout", "stderr"):
        yield from _file_differs(old / stream, new / stream, checkouts, stream)
    listings = [{str(p.relative_to(f / "files")) for p in (f / "files").rglob("*")} for f in (old, new)]
    for name in sorted(listings[0] ^ listings[1]):
        yield f"{name} written by {'the reference' if name in listings[0] else 'this checkout'} only"
    for name in sorted(listings[0] & listings[1]):
        if not (old / "files" / name).is_dir():
            yield from _file_differs(old / "files" / name, new / "files" / name, checkouts, name)


def _file_differs(old: Path, new: Path, checkouts: tuple[Path, Path], name: str) -> Iterator[str]:
    contents = [_undated(path.read_bytes()) if path.exists() else b"" for path in (old, new)]
    if contents[0] == contents[1]:
        return
    try:
        texts = [
            _normal(content.decode(), checkout) for content, checkout in zip(contents, checkouts, strict=True)
        ]
    except UnicodeDecodeError:
        texts = None
    if texts is None:
        if contents[0] != contents[1]:
            size = min(map(len, contents))
            at = next((i for i in range(size) if contents[0][i] != contents[1][i]), size)
            yield f"{name}: {len(contents[0])} and {len(contents[1])} bytes, first different at {at}"
        return
    if texts[0] == texts[1]:
        return
    try:
        records = [_plain(json.loads(text)) for text in texts]
    except json.JSONDecodeError:
        lines = [text.splitlines() for text in texts]
        at = next((i for i, (x, y) in enumerate(zip(*lines, strict=False)) if x != y), min(map(len, lines)))
        shown = [repr(text[at][:160]) if at < len(text) else "nothing" for text in lines]
        yield f"{name}: line {at + 1}: {shown[0]} | {shown[1]}"
    else:
        if found := next(_record_differs(*records, "")):
            yield f"{name}: {found}"


_SECONDS = re.compile(r"\b\d+\.\d+(e-?\d+)? s\b")
_TRACE = re.compile(
    r"^Traceback \(most recent call last\):\n((?: .*|During .*|The above .*|Traceback.*|)\n)*", re.M
)
_DATE = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?")  # meshio writes it into some formats
_FOLDER = re.compile(r"/\S*-[0-9a-f]{12}\.\d+\.\d+/files\b")  # where a command ran
_ADDRESS = re.compile(r"0x[0-9a-f]{6,}")


def _undated(content: bytes) -> bytes:
    """The bytes of a file without dates and, in HDF5, the checksums of headers that may hold one."""
    if content.startswith(b"\x89HDF"):
        content = re.sub(rb"(?s)....(?=OHDR)", b"", content)
    return _DATE.sub(b"DATE", content)


def _normal(text: str, checkout: Path) -> str:
    """A text without times, traces of errors, addresses and places."""
    text = _TRACE.sub("Traceback\n", _FOLDER.sub("FOLDER", text.replace(str(checkout), "CHECKOUT")))
    return _ADDRESS.sub("ADDRESS", _SECONDS.sub("N s", text))


def _plain(record: Any) -> Any:
    """A report without seconds and the version."""
    if isinstance(record, dict):
        left_out = ("seconds", "dvr_version")
        return {key: _plain(value) for key, value in record.items() if key not in left_out}
    return [_plain(value) for value in record] if isinstance(record, list | tuple) else record


def _record_differs(old: Any, new: Any, where: str) -> Iterator[str]:
    """The first place where two reports differ, then nothing."""
    if isinstance(old, dict) and isinstance(new, dict):
        if list(old) != list(new):
            yield f"{where or 'report'}: keys {list(old)} | {list(new)}"
        for key in old:
            yield from filter(None, [next(_record_differs(old[key], new.get(key), f"{where}.{key}"))])
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, (x, y) in enumerate(zip(old, new, strict=True)):
            yield from filter(None, [next(_record_differs(x, y, f"{where}[{i}]"))])
    elif old != new or type(old) is not type(new):
        yield f"{where}: {str(old)[:80]} | {str(new)[:80]}"
    yield ""


# ---------------------------------------------------------------------------------------------------- main


def main() -> int:
    """Compare, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("other", type=Path, help="the checkout that is the reference")
    parser.add_argument(
        "--this", type=Path, default=HERE, help="the checkout compared with it; default: this"
    )
    parser.add_argument("--only", default="", help="only commands that hold this text")
    parser.add_argument("--small", action="store_true", help="a choice that covers every module")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir(), "same_bytes_cache"))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--list", action="store_true", help="print the commands and run none")
    parser.add_argument("--fill", action="store_true", help="run the reference alone, to fill the cache")
    options = parser.parse_args()
    todo = [command for command in commands(options.small) if options.only in command]
    if options.list:
        print("\n".join(todo))
        return 0

    begin, cache = time.time(), options.cache.resolve()
    cache.mkdir(parents=True, exist_ok=True)
    warm = not options.small
    reference, this = Checkout(options.other.resolve(), warm), Checkout(options.this.resolve(), warm)
    inputs = inputs_of(reference, cache)
    commit = reference.commit()
    with tempfile.TemporaryDirectory(dir=cache) as scratch:
        results = cache / commit if commit else Path(scratch, "reference")
        counts = {"alike": 0, "different": 0}
        lock = threading.Lock()

        def compare(command: str) -> None:
            old = place_of(command, results, inputs)
            if not old.exists():
                reference.run(command, inputs, old)
            if options.fill:
                return
            new = place_of(command, Path(scratch), inputs)
            this.run(command, inputs, new)
            found = list(differences(old, new, (reference.path, this.path)))
            with lock:
                counts["different" if found else "alike"] += 1
                if not (done := sum(counts.values())) % 50:
                    print(f"{done} of {len(todo)}: {command}", file=sys.stderr, flush=True)
                for line in found:
                    print(f"dvr {command}: {line}", flush=True)
            if found:
                kept = cache / "differs" / new.name
                shutil.rmtree(kept, ignore_errors=True)
                shutil.copytree(old, kept / "a")
                shutil.copytree(new, kept / "b")
            shutil.rmtree(new)

        try:
            compiled = [command for command in todo if "--engine numba" in command][:1]
            for command in compiled:  # one alone first: what it compiles need not be compiled twice
                compare(command)
            with ThreadPoolExecutor(options.jobs) as pool:
                list(pool.map(compare, [command for command in todo if command not in compiled]))
        finally:
            reference.close()
            this.close()
    print(
        f"{len(todo)} commands: {counts['alike']} alike, {counts['different']} different; "
        f"{time.time() - begin:.0f} s; reference {options.other} at {commit or 'no commit'}"
    )
    return 1 if counts["different"] else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(sys.argv[2])
    elif sys.argv[1:2] == ["--make"]:
        make_inputs(Path(sys.argv[3]), Path(sys.argv[2]))
    else:
        sys.exit(main())
