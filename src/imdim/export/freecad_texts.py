"""What FreeCAD macros begin with: functions that make objects whose properties follow the names of a spreadsheet.

Known of FreeCAD 0.20 and newer: a property follows an expression once `setExpression` was called, also a datum of a sketch by its number;
the edges of Part::Fillet follow none, but the radius of PartDesign::Fillet does, whose body can have any solid as its base.
"""

SHEET = '''document = App.newDocument("part")
sheet = document.addObject("Spreadsheet::Sheet", "Parameters")
for row, (name, unit) in enumerate(UNITS.items(), 1):
    sheet.set(f"A{row}", name)
    sheet.set(f"B{row}", f"={globals()[name]} {unit}".rstrip())
    sheet.setAlias(f"B{row}", name)
document.recompute()


def follows(text):
    """An expression of names as properties read it."""
    return re.sub(r"[A-Za-z_]\\w*", lambda word: f"Parameters.{word[0]}" if word[0] in UNITS else word[0], text)


def put(thing, name, value):
    """Let a property have a value, or follow an expression of names."""
    if isinstance(value, str) and any(word in UNITS for word in re.findall(r"[A-Za-z_]\\w*", value)):
        thing.setExpression(name, follows(value))
    else:
        setattr(thing, name, value)


def add(kind, label, at=(0, 0, 0), turn=(0, 0, 0), **properties):
    """An object that is turned by degrees about x, y and z, and then moved."""
    thing = document.addObject("Part::" + kind, label)
    fixed, turned = ([0 if isinstance(c, str) else c for c in three] for three in (at, turn))
    thing.Placement = App.Placement(App.Vector(*fixed), App.Rotation(*reversed(turned)))
    places = {f"Placement.Base.{axis}": c for axis, c in zip("xyz", at)} | {"Placement.Rotation.Angle": turn[2]}
    for name, value in [*places.items(), *properties.items()]:
        if name in properties or isinstance(value, str):
            put(thing, name, value)
    for part in thing.OutList:
        part.Visibility = part is sheet
    return thing


'''

FUSE = '''def fuse(*parts):
    """The union."""
    return add("MultiFuse", "union", Shapes=list(parts), Refine=True)


'''

CUT = '''def cut(part, *tools):
    """What is left of a part."""
    return add("Cut", "cut", Base=part, Tool=fuse(*tools) if len(tools) > 1 else tools[0], Refine=True)


'''

COMMON = '''def common(part, *others):
    """What all have in common, two by two: versions of FreeCAD differ in what a Common of more is."""
    for other in others:
        part = add("Common", "common", Base=part, Tool=other, Refine=True)
    return part


'''

SKETCHES = '''def read_number(text):
    """The value of an expression, in millimetres or degrees, or a number as it is."""
    return float(sheet.evalExpression(follows(text))) if isinstance(text, str) else text


def read_arc(arc):
    """What `curves` reads for an arc."""
    if isinstance(arc, tuple):
        return arc[1] * tan(read_number(arc[0]) * pi / 720)
    return list(map(read_number, arc)) if isinstance(arc, list) else arc


def constrain(sketch, kind, text, *where):
    """Add a constraint to a sketch whose datum is a number, or follows an expression."""
    value = read_number(text)
    datum = sketch.addConstraint(Sketcher.Constraint(kind, *where, value * pi / 180 if kind == "Angle" else value))
    if isinstance(text, str):
        sketch.setExpression(f"Constraints[{datum}]", follows(text))


def place(sketch, x, y, *where):
    """Put a point of a curve at a place."""
    constrain(sketch, "DistanceX", x, -1, 1, *where)
    constrain(sketch, "DistanceY", y, -1, 1, *where)


def draw_circle(sketch, r, x=0, y=0):
    """A circle in a sketch."""
    center = App.Vector(read_number(x), read_number(y))
    curve = sketch.addGeometry(Part.Circle(center, App.Vector(0, 0, 1), read_number(r)))
    place(sketch, x, y, curve, 3)
    constrain(sketch, "Radius", r, curve)


def draw(sketch, loop):
    """A closed loop in a sketch, of vertices [x, y] and [x, y, arc] as `curves` has them; an arc may also be (angle, way), the degrees by
    which it turns. A loop of more than MOST_DRIVEN curves has no constraints and stays as it is drawn."""
    n = len(loop)
    read = [[*map(read_number, v[:2]), *map(read_arc, v[2:])] for v in loop]
    curve, starts, ends = [], [], []
    for start, *middle, end in curves(read):
        a, b = App.Vector(*start), App.Vector(*end)
        between = [App.Vector(*p) for p in middle]
        forward = not between or (b - a).cross(between[0] - a).z < 0
        points = [a, *between, b] if forward else [b, *between, a]
        curve.append(sketch.addGeometry((Part.Arc if between else Part.LineSegment)(*points)))
        starts.append((curve[-1], 1 if forward else 2))
        ends.append((curve[-1], 2 if forward else 1))
    if n > MOST_DRIVEN:
        print(f"{sketch.Label}: a loop of {n} curves stays as it is drawn")
        return
    arcs = [v[2] if len(v) > 2 else None for v in loop]
    rounds = [isinstance(arc, list) and len(arc) == 1 for arc in arcs]
    about = [isinstance(arc, list) and len(arc) == 2 and loop[i][:2] == loop[(i + 1) % n][:2] for i, arc in enumerate(arcs)]
    for i, (x, y, *_) in enumerate(loop):
        placed = not (rounds[i] or about[i] or rounds[i - 1] or about[i - 1])
        smooth = not placed or arcs[i] in ("before", "cusp before") or arcs[i - 1] in ("after", "cusp after")
        sketch.addConstraint(Sketcher.Constraint("Tangent" if smooth else "Coincident", *ends[i - 1], *starts[i]))
        if placed:
            place(sketch, x, y, *starts[i])
    for i, arc in enumerate(arcs):
        x, y = loop[i][:2]
        if rounds[i]:
            corner = sketch.addGeometry(Part.Point(App.Vector(*read[i][:2])), True)
            place(sketch, x, y, corner, 1)
            for line in (curve[i - 1], curve[(i + 1) % n]):
                sketch.addConstraint(Sketcher.Constraint("PointOnObject", corner, 1, line))
        if about[i]:
            place(sketch, x, y, curve[i], 3)
        if isinstance(arc, list) and len(arc) == 3:
            # the ends say one of the centre's coordinates
            (a, b), (c, d) = read[i][:2], read[(i + 1) % n][:2]
            axis = int(abs(b - d) < abs(a - c))
            constrain(sketch, ("DistanceX", "DistanceY")[axis], arc[axis], -1, 1, curve[i], 3)
        elif isinstance(arc, list):
            constrain(sketch, "Radius", arc[0], curve[i])
        elif isinstance(arc, tuple):
            constrain(sketch, "Angle", arc[0], curve[i])
        elif isinstance(arc, (int, float)):
            constrain(sketch, "Angle", 720 * atan(abs(arc)) / pi, curve[i])


def sketch_of(label, loops):
    """A sketch of loops that are lists of vertices or circles (r, x, y)."""
    sketch = document.addObject("Sketcher::SketchObject", label + "_sketch")
    for loop in loops:
        draw_circle(sketch, *loop) if isinstance(loop, tuple) else draw(sketch, loop)
    if sketch.solve() != 0:
        print(f"{sketch.Label} stays as it is drawn: FreeCAD does not solve its constraints")
        for datum in reversed(range(sketch.ConstraintCount)):
            sketch.setExpression(f"Constraints[{datum}]", None)
            sketch.delConstraint(datum)
    return sketch


def area(label, loops):
    """What an odd number of loops hold: a sketch of those that are drawn, and what others make.

    Beside others each has a sketch of its own: of loops in a sketch and loops beside it FreeCAD makes faces that overlap.
    """
    drawn = [loop for loop in loops if not callable(loop)]
    others = [loop(label) for loop in loops if callable(loop)]
    if not others:
        return sketch_of(label, drawn)
    return add("Compound", label + "_loops", Links=[*(sketch_of(label, [loop]) for loop in drawn), *others])


'''

POLYGON = '''def polygon(sides, r, x=0, y=0, angle=0):
    """A loop that is a regular polygon with a corner at an angle."""
    return lambda label: add("RegularPolygon", label + "_polygon", at=(x, y, 0), turn=(0, 0, angle), Polygon=sides, Circumradius=r)


'''

ACROSS_FLATS = '''def across_flats(sides, width, x=0, y=0, angle=0):
    """The same by its width from side to side."""
    length = width if isinstance(width, str) else f"{width} mm"
    return polygon(sides, f"({length}) / (2 * cos(180 deg / ({sides})))", x, y, angle)


'''

ELLIPSE = '''def ellipse(rx, ry, x=0, y=0, angle=0):
    """A loop that is an ellipse, its first semi-axis at an angle. FreeCAD has the longer one first."""
    if read_number(rx) < read_number(ry):
        rx, ry, angle = ry, rx, f"{angle} + 90 deg" if isinstance(angle, str) else angle + 90
    return lambda label: add("Ellipse", label + "_ellipse", at=(x, y, 0), turn=(0, 0, angle), MajorRadius=rx, MinorRadius=ry)


'''

EXTRUDED = '''def extruded(label, height, *loops, **place):
    """Loops from -height / 2 to height / 2 along z."""
    upwards = {"DirMode": "Custom", "Dir": App.Vector(0, 0, 1), "Symmetric": True}
    return add("Extrusion", label, Base=area(label, loops), **upwards, LengthFwd=height, Solid=True, FaceMakerClass=FACE_MAKER, **place)


'''

DRAFTED = '''def drafted(label, height, draft, *loops, **place):
    """Loops from -height / 2 to height / 2 along z, at the foot as they are drawn; walls lean inward by an angle on the way up."""
    source = area(label, loops)
    source.Placement = App.Placement(App.Vector(0, 0, -read_number(height) / 2), App.Rotation())
    if isinstance(height, str):
        put(source, "Placement.Base.z", f"-({height}) / 2")
    inward = f"-({draft})" if isinstance(draft, str) else -draft
    upwards = {"DirMode": "Custom", "Dir": App.Vector(0, 0, 1), "LengthFwd": height, "TaperAngle": inward}
    return add("Extrusion", label, Base=source, **upwards, Solid=True, FaceMakerClass=FACE_MAKER, **place)


'''

TURNED = '''def turned(label, angle, *loops, **place):
    """Loops in the plane of x and z, turned about z."""
    source = area(label, loops)
    source.Placement = App.Placement(App.Vector(), App.Rotation(0, 0, 90))
    about = {"Base": App.Vector(), "Axis": App.Vector(0, 0, 1)}
    return add("Revolution", label, Source=source, **about, Angle=angle, Solid=True, FaceMakerClass=FACE_MAKER, **place)


'''

BLENDS = '''def edges_of(part):
    """All edges of a part."""
    return part.Shape.Edges


def points_of(edge):
    """Some points of an edge, its middle first."""
    first, last = edge.ParameterRange
    return [tuple(edge.valueAt(first + t * (last - first))) for t in (0.5, 0.1, 0.3, 0.7, 0.9)]


def points_beside(edge, face):
    """Two points by the middle of an edge, one of which is on the face."""
    middle = sum(edge.ParameterRange) / 2
    point = edge.valueAt(middle)
    across = edge.tangentAt(middle).cross(face.normalAt(*face.Surface.parameter(point))) * (edge.Length / 100)
    return tuple(point + across), tuple(point - across)


def in_body(part):
    """A part as the base of a body, whose fillets and chamfers follow the parameters; as it is if it is several solids."""
    document.recompute()
    if len(part.Shape.Solids) > 1:
        print("the part is several solids: its fillets and chamfers keep their sizes")
        return part
    body = document.addObject("PartDesign::Body", "part")
    body.BaseFeature = part
    document.recompute()
    body.Tip.setExpression("Placement", f"{part.Name}.Placement")
    part.Visibility = False
    document.recompute()
    return body.Tip


def add_blend(part, kind, edges, sizes, **properties):
    """A fillet or a chamfer of edges of a part, of sizes or, in a body, of properties that follow names; an error if that fails."""
    numbers = [k for k, edge in enumerate(part.Shape.Edges, 1) if any(map(edge.isSame, edges))]
    body = part.getParentGeoFeatureGroup()
    if body is None:
        feature = add(kind, kind.lower(), Base=part, Edges=[(k, sizes[0], sizes[-1]) for k in numbers])
    else:
        feature = body.newObject("PartDesign::" + kind, kind.lower())
        feature.Base = (part, [f"Edge{k}" for k in numbers])
        for name, value in properties.items():
            put(feature, name, value)
    document.recompute()
    if not feature.isValid() or feature.Shape.isNull():
        said = feature.getStatusString()
        if body is not None:
            body.removeObject(feature)
            body.Tip = part
        document.removeObject(feature.Name)
        document.recompute()
        raise ValueError(said)
    part.Visibility = False
    return feature


def fillet_edges(radius):
    """What rounds edges by a named radius."""

    def fillet_edges(part, edges, sizes, first):
        return add_blend(part, "Fillet", edges, sizes, Radius=radius)

    return fillet_edges


def chamfer_edges(distance, second=None):
    """What bevels edges by a named distance, or by two, of which the first is that along the first face."""

    def chamfer_edges(part, edges, sizes, first):
        if second is None:
            return add_blend(part, "Chamfer", edges, sizes, Size=distance)
        # FreeCAD measures the first one along the first face of the part that has the edge, unless flipped
        faces = [[face for face in part.Shape.Faces if any(map(edge.isSame, face.Edges))] for edge in edges]
        flipped = {beside(edge, one, first) > beside(edge, two, first) for edge, (one, two) in zip(edges, faces)}
        if len(flipped) > 1:
            raise ValueError("the edges lie on both sides of their faces")
        is_flipped = True in flipped
        two = {"ChamferType": "Two distances", "Size": distance, "Size2": second, "FlipDirection": is_flipped}
        return add_blend(part, "Chamfer", edges, sizes[::-1] if is_flipped else sizes, **two)

    return chamfer_edges


'''

END = """
document.recompute()
if App.GuiUp:
    App.Gui.SendMsgToActiveView("ViewFit")
"""
