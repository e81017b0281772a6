"""Abaqus decks: one for each way that people and programs write them, all with an inner vertex to move."""

FLAT = """*HEADING
plate
*NODE, NSET=NALL
100, 0.0, 0.0, 0.
110, 2.0, 0.0, 0.
120, 2.0, 2.0, 0.
130, 0.0, 2.0, 0.
900, 1.6, 1.5, 0.
*ELEMENT, TYPE=CPS3, ELSET=PLATE
5001, 100, 110, 900
5002, 110, 120, 900
5003, 120, 130, 900
5004, 130, 100, 900
*NSET, NSET=LEFT
100, 130
*SURFACE, NAME=TOP, TYPE=ELEMENT
5003, S1
*SOLID SECTION, ELSET=PLATE, MATERIAL=STEEL
0.1
*MATERIAL, NAME=STEEL
*ELASTIC
210000., 0.3
*STEP
*STATIC
*BOUNDARY
LEFT, 1, 2
*DLOAD
5003, P1, 1.
*NODE PRINT, NSET=NALL
U
*END STEP
"""

# A box of eight tetrahedra around one vertex off its middle.
BOX = """ ** made by hand
*Heading
** Node, not a keyword
  *node , nset = "All Nodes"
 1, -1, 0., 0.0D0,
 2,  1, 0.,
 3,, -1.
 4, 0, 1
 5, 0, , -1.0d+0
**      comment among nodes
 6, 0, 0., +1
 7, .2, .1-0, 1.5E-1, 0., 0., 1.
*Element, type=c3d4,
 elset=Ball
 1, 1, 3, 5,
 7
 2, 3, 2, 5
 7

 3, 2, 4, 5, 7
 4, 4, 1, 5, 7,
 5, 3, 1, 6, 7
*Element, type=C3D4, elset=Ball
 6, 2, 3, 6, 7
 7, 4, 2, 6, 7
 8, 1, 4, 6, 7
*Nset, nset=Ends, generate
 1, 5, 4
*Elset, elset=Odd, generate
 1, 8, 2
*Elset, elset=Both
 Odd, 2
*Surface, name=Skin
 Odd, S1
*SolidSection, elset=Ball, material=M
"""

PARTS = """*Part, name=Left
*Node
1, 0, 0
2, 1, 0
3, 1, 1
4, 0, 1
5, .7, .6
*Element, type=CPE3
1, 1, 2, 5
2, 2, 3, 5
3, 3, 4, 5
4, 4, 1, 5
*Nset, nset=Fixed
1, 4
*End Part
*Part, name=Right
*Node
1, 5, 0
2, 7, 0
3, 7, 2
4, 5, 2
5, 6.4, 1.2
*Element, type=CPE3
1, 1, 2, 5
2, 2, 3, 5
3, 3, 4, 5
4, 4, 1, 5
*Nset, nset=Fixed
2
*End Part
*Part, name=Empty
*End Part
*Assembly, name=A
*Instance, name=Left-1, part=Left
0., 0., 3.
*End Instance
*Instance, name="Right 1", part=Right
10., 0., 0.
0., 0., 0., 0., 0., 1., 90.
*End Instance
*Instance, name=Own, part=Empty
*Node
1, 20, 0
2, 21, 0
3, 21, 1
4, 20, 1
5, 20.2, .2
*Element, type=CPE3
1, 1, 2, 5
2, 2, 3, 5
3, 3, 4, 5
4, 4, 1, 5
*End Instance
*Node
1, 50., 50.
*Nset, nset=Corners, instance=Left-1
1, 3
*Nset, nset=Corners, instance="Right 1"
2
*Nset, nset=Named
Left-1.2, "Right 1".5, Own.Missing, Left-1.Fixed
*Elset, elset=Some, instance=Own, generate
2, 4
*Element, type=SPRINGA, elset=Springs
1, Left-1.2, Own.1
*End Assembly
*Step
*Boundary
Corners, 1
*End Step
"""

# Eight bricks of the second order around an inner vertex, made by ``bricks``.
TWO_MATERIALS = """*NODE
1, 0, 0
2, 1, 0
3, 2, 0
4, 0, 1
5, 1.2, 1.1
6, 2, 1
7, 0, 2
8, 1, 2
9, 2, 2
10, .4, .5
11, 1.5, .4
*ELEMENT, TYPE=CPS3, ELSET=STEEL
1, 1, 2, 10
2, 2, 5, 10
3, 5, 4, 10
4, 4, 1, 10
*ELEMENT, TYPE=CPS4, ELSET=STEEL
9, 4, 5, 8, 7
*ELEMENT, TYPE=CPS3, ELSET=BRASS
5, 2, 3, 11
6, 3, 6, 11
7, 6, 5, 11
8, 5, 2, 11
*ELEMENT, TYPE=CPS4, ELSET=BRASS
10, 5, 6, 9, 8
"""

DECKS = {
    "flat": FLAT.encode(),
    "box": BOX.encode(),
    "parts": PARTS.encode(),
    "two materials": TWO_MATERIALS.encode(),
    "carriage returns": FLAT.replace("\n", "\r\n").encode(),
    "old Macintosh": FLAT.replace("\n", "\r").encode(),
    "byte order mark": b"\xef\xbb\xbf" + FLAT.encode(),
    "no line end": FLAT.split("*NSET")[0].rstrip().encode(),
}
