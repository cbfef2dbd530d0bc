"""Kinds of files, recognised by their first bytes or, for texts, by the whole text; and how to
convert each.

A file's name may be misleading; its first bytes are not. The reader of a file that a user names
calls `require`, or `cocap_opt.scenarios.text.read_text`, with the kinds that it can read.

`kind_of_text` distinguishes kinds of JSON, which requires the whole text.

Source of the bytes: the specification of each format, or its own writers' files.
"""

import os
import re
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from cocap_opt.data import ProblemError

BEGIN = 4096  # number of first bytes that are examined

_PEOPLE = "write its people as a table with the columns id, time, x and y"
_GPSBABEL = "convert it with gpsbabel to .gpx, for [[tracks]]"
_MESH = "for [[mesh]] of a recipe, if it is .obj, .glb, .gltf, .stl, .ply or .off"
_TO_MESH = "convert it with Blender to .glb, for [[mesh]] of a recipe"
_MAP = "a map, for [map] of a recipe"
_TO_MAP = "convert its heights with gdal_translate to .tif, for [map] of a recipe"
_WALLS = "convert its polygons with ogr2ogr -f GeoJSON, for [[walls]] of a recipe"
_UNPACK = "unpack it, and pass the file inside"
_PICTURE = "an image contains no heights or positions"
_TO_CSV = "(..).to_csv(.., index=False)"
_RASTERISE = "CloudCompare to a .tif, for [map] of a recipe"
_IN_A_RECIPE = "of a recipe; `cocap-opt recipe` prints an example"
_FILM = "a video contains no positions: track its people, and write a table with id, time, x and y"


class Kind(NamedTuple):
    """A kind of files."""

    name: str  # as in "is NAME"
    way_out: str  # where to use the file, or how to convert it


GPX = Kind("GPX", "it is for people, under [[tracks]] of a recipe")
SQLITE = Kind("an SQLite database", "one from JuPedSim is for people, under [[tracks]] of a "
              "recipe; export others as tables")  # fmt: skip
JSON = Kind("JSON", "walls in JSON or GeoJSON are for [[walls]] of a recipe; people are a table "
            "with the columns id, time, x and y")  # fmt: skip
WKT = Kind("WKT", f"name it under [[walls]] {_IN_A_RECIPE}")
GEOJSON = Kind("GeoJSON", f"name it under [[walls]] {_IN_A_RECIPE}")
GROUND_PLAN = Kind("a ground plan in JSON", f"name it under [[walls]] {_IN_A_RECIPE}")
CITYJSON = Kind("CityJSON", "convert its buildings to .obj, e.g. with cjio, and name that file "
                f"under [[mesh]] {_IN_A_RECIPE}")  # fmt: skip
TIFF = Kind("a TIFF", _MAP)
ESRI_ASCII = Kind("an ESRI ASCII grid", _MAP)
NUMPY = Kind("a NumPy array", f"{_PEOPLE}, e.g. with numpy.savetxt")
GLB = Kind("a binary glTF", f"a mesh, {_MESH}")
PLY = Kind("a PLY", f"a mesh, {_MESH}")
OFF = Kind("an OFF", f"a mesh, {_MESH}")
STL = Kind("an STL", f"a mesh, {_MESH}")

_GEOJSON_LINES = Kind(
    "GeoJSON with a feature on each line",
    "convert it with `ogr2ogr NEW.geojson OLD.geojsonl`, for [[walls]]",
)
_JSON_LINES = Kind("JSON lines (e.g. of TrajNet++)", f"read each line as JSON, and {_PEOPLE}; in "
                   "TrajNet++ p is an id, and f a frame")  # fmt: skip
_ZIP = Kind("a ZIP archive", _UNPACK)
_KMZ = Kind("a KMZ", f"unzip it to KML; {_GPSBABEL}")
_MESH_ARCHIVE = Kind("a 3MF or USDZ", _TO_MESH)
_EXCEL = Kind("an Excel or other Office file", "save its table as CSV in UTF-8")
_OPEN_DOCUMENT = Kind("an OpenDocument file", "save its table as CSV in UTF-8")
_NPZ = Kind("an archive of NumPy arrays", f"{_PEOPLE}, e.g. with numpy.savetxt")
_GEOPACKAGE = Kind("a GeoPackage", _WALLS)
_ROS_2 = Kind("a ROS 2 bag", f"read it with ros2 bag or rosbags, and {_PEOPLE}")

_POSTGRES = Kind("a PostgreSQL dump", f"restore it, and {_PEOPLE}")
_ACCESS = Kind("an Access database", f"save its table as CSV: {_PEOPLE}")
_NETCDF = Kind("NetCDF", _TO_MAP)
_SURFER = Kind("a Surfer grid", _TO_MAP)
_PICKLE = Kind("a Python pickle", f"it is never opened, as it may run code: {_PEOPLE}")
_PCAP = Kind("a network capture (PCAP)", _PEOPLE)
_FBX = Kind("an FBX", _TO_MESH)
_USD = Kind("USD", _TO_MESH)
_CALIBRATION = Kind(
    "a camera calibration", "write its numbers in [[drones]] of a recipe: camera = { width = 1920, "
    "height = 1080, focal = 1400 }, in px with focal = fx; lens distortion and an off-centre "
    "principal point are not modelled"
)  # fmt: skip
_TO_GRID = (
    "write it as an .asc for [map], with cellsize = resolution, xllcorner and yllcorner = its "
    "origin (whose yaw must be 0), and in each cell the height of the wall in m, or 0 where it is "
    "free"
)
_ROS_MAP = Kind("a map of ROS", f"it has no heights: {_TO_GRID}")
_PGM = Kind("a PGM image, such as a map of ROS", f"it has no heights: {_TO_GRID}")
_GAZEBO = Kind("a world or model of Gazebo or ROS", "convert its meshes with Blender to .glb, for "
               "[[mesh]] of a recipe")  # fmt: skip
_ROWS_OF_FRAMES = Kind(
    "football data with a frame on each line (TRACAB, FIFA EPTS)",
    f"read it with kloppy, and {_PEOPLE}, in metres",
)
_VTK = Kind("a VTK file", "convert it with meshio or ParaView to .ply, for [[mesh]]")

Marks = dict[bytes | tuple[int, bytes], Kind]  # bytes at the very beginning, or at a position

# A text may begin with the same letters, e.g. with the id PAR1, so these files must be binary.
_BINARY: Marks = {
    # databases and tables
    b"SQLite format 3\0": SQLITE,
    b"\x89HDF\r\n\x1a\n": Kind("HDF5", "export its trajectories as text, with the columns id "
                               "frame x y; if it is NetCDF, convert its heights with "
                               "gdal_translate to .tif"),
    (8, b"DUCK"): Kind("a DuckDB database", f"{_PEOPLE}, e.g. with COPY to CSV"),
    (4, b"Standard Jet DB"): _ACCESS,
    (4, b"Standard ACE DB"): _ACCESS,
    b"PGDMP": _POSTGRES,
    b"PAR1": Kind("Parquet", f"convert it to CSV with pandas.read_parquet{_TO_CSV}"),
    b"ARROW1": Kind("an Arrow or Feather file",
                    f"convert it to CSV with pandas.read_feather{_TO_CSV}"),
    b"FEA1": Kind("a Feather file", f"convert it to CSV with pandas.read_feather{_TO_CSV}"),
    b"ORC": Kind("ORC", f"convert it to CSV with pandas.read_orc{_TO_CSV}"),
    b"Obj\x01": Kind("Avro", _PEOPLE),
    b"\x93NUMPY": NUMPY,
    b"\x80\x02": _PICKLE,
    b"\x80\x03": _PICKLE,
    b"\x80\x04": _PICKLE,
    b"\x80\x05": _PICKLE,
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": Kind("an old Excel or Word file",
                                              "save its table as CSV in UTF-8"),
    # archives
    b"PK\x03\x04": _ZIP,
    b"PK\x05\x06": Kind("an empty ZIP archive", "it contains no file"),
    b"\x1f\x8b": Kind("compressed with gzip", "unpack it with gunzip"),
    b"BZh": Kind("compressed with bzip2", "unpack it with bunzip2"),
    b"\xfd7zXZ\0": Kind("compressed with xz", "unpack it with unxz"),
    b"\x28\xb5\x2f\xfd": Kind("compressed with Zstandard", "unpack it with unzstd"),
    b"\x04\x22\x4d\x18": Kind("compressed with LZ4", "unpack it with unlz4"),
    b"7z\xbc\xaf\x27\x1c": Kind("a 7z archive", _UNPACK),
    b"Rar!\x1a\x07": Kind("a RAR archive", _UNPACK),
    (257, b"ustar"): Kind("a tar archive", _UNPACK),
    # pictures and films
    b"\x89PNG\r\n\x1a\n": Kind("a PNG", _PICTURE),
    b"\xff\xd8\xff": Kind("a JPEG", _PICTURE),
    b"GIF8": Kind("a GIF", _PICTURE),
    (8, b"WEBP"): Kind("a WebP", _PICTURE),
    (8, b"AVI "): Kind("an AVI", _FILM),
    (4, b"ftyp"): Kind("a video or a phone's photo (MP4, MOV or HEIC)", _FILM),
    b"\x1a\x45\xdf\xa3": Kind("a video (Matroska or WebM)", _FILM),
    # maps
    b"II*\0": TIFF,
    b"MM\0*": TIFF,
    b"II+\0": TIFF,
    b"MM\0+": TIFF,
    b"\x00\x00\x00\x0cjP  ": Kind("a JPEG 2000", _TO_MAP),
    b"CDF\x01": _NETCDF,
    b"CDF\x02": _NETCDF,
    b"CDF\x05": _NETCDF,
    b"GRIB": Kind("GRIB", _TO_MAP),
    b"EHFA_HEADER_TAG": Kind("an ERDAS Imagine raster", _TO_MAP),
    b"DSBB": _SURFER,
    b"DSRB": _SURFER,
    b"LASF": Kind("a point cloud (LAS or LAZ)", f"rasterise it with PDAL or {_RASTERISE}"),
    b"ASTM-E57": Kind("a point cloud (E57)", f"rasterise it with {_RASTERISE}"),
    b"AC10": Kind("a DWG drawing", "save it as DXF; " + _WALLS),
    b"\x00\x00\x27\x0a": Kind("a shapefile", _WALLS),
    b"fgb\x03": Kind("FlatGeobuf", _WALLS),
    # meshes
    b"glTF": GLB,
    b"Kaydara FBX Binary": _FBX,
    b"BLENDER": Kind("a Blender file", _TO_MESH),
    b"PXR-USDC": _USD,
    b"DRACO": Kind("a Draco mesh", "convert it with draco_decoder to .obj or .ply, for [[mesh]]"),
    # recordings
    b"\x89MCAP0\r\n": Kind("an MCAP bag", f"read it with the mcap library, and {_PEOPLE}"),
    b"\xd4\xc3\xb2\xa1": _PCAP,
    b"\xa1\xb2\xc3\xd4": _PCAP,
    b"\x4d\x3c\xb2\xa1": _PCAP,
    b"\x0a\x0d\x0d\x0a": _PCAP,
    b"ULog\x01\x12\x35": Kind("a PX4 log", f"convert its topics with ulog2csv, and {_PEOPLE}"),
    b"\xa3\x95\x80": Kind("an ArduPilot log", f"convert it with mavlogdump.py, and {_PEOPLE}"),
    b"\xb5\x62": Kind("a u-blox log", "convert it with RTKLIB or gpsbabel to .gpx, for [[tracks]]"),
    (8, b".FIT"): Kind("FIT, from a sports watch", _GPSBABEL),
}  # fmt: skip

_TEXTS: Marks = {  # beginnings of texts, long enough that no other text begins with them
    b"-- PostgreSQL database dump": _POSTGRES,
    b"--\n-- PostgreSQL database dump": _POSTGRES,
    b"-- MySQL dump": Kind("a MySQL dump", f"restore it, and {_PEOPLE}"),
    b"MATLAB 5.0 MAT-file": Kind("a MATLAB file", f"{_PEOPLE}, with writematrix in MATLAB or with "
                                 "scipy.io.loadmat"),
    b"{\\rtf": Kind("rich text", "save it as plain text in UTF-8"),
    b"%PDF": Kind("a PDF", "it contains no heights or positions: ask for the underlying data"),
    b"Pix4D camera calibration file": _CALIBRATION,
    b"# Camera list with one line": _CALIBRATION,  # of COLMAP
    b"# Octomap OcTree": Kind("an octree of OctoMap", f"export its cells as a mesh, {_MESH}"),
    b"DSAA\n": _SURFER,
    b"DSAA\r": _SURFER,
    b"# .PCD": Kind("a point cloud (PCD)", f"rasterise it with {_RASTERISE}"),
    b"ply\n": PLY,
    b"ply\r": PLY,
    b"; FBX": _FBX,
    b"#usda": _USD,
    b"# vtk DataFile": _VTK,
    b"ISO-10303-21": Kind("STEP or IFC", "convert it with IfcConvert or FreeCAD to .glb or .obj, "
                          "for [[mesh]] of a recipe"),
    b"#ROSBAG V": Kind("a ROS bag", f"read it with rostopic echo -p or rosbags, and {_PEOPLE}"),
    b"HIERARCHY": Kind("BVH", f"it is motion capture of a skeleton: {_PEOPLE}, from its root"),
    b"PathFileType": Kind("TRC, motion capture",
                          f"{_PEOPLE}, from one marker per person, without the vertical axis"),
    b"Format Version,": Kind("a CSV file of OptiTrack Motive",
                             f"{_PEOPLE}, from one body or marker per person"),
    b"NO_OF_FRAMES": Kind("a Qualisys table", f"{_PEOPLE}, from one marker per person"),
    b"version https://git-lfs": Kind("a Git LFS pointer, not the file itself",
                                     "download the file with `git lfs pull`"),
}  # fmt: skip

_ROOTS = {  # roots of XML, by name without a prefix, in lower case
    "gpx": GPX,
    "kml": Kind("KML", _GPSBABEL + "; " + _WALLS),
    "trainingcenterdatabase": Kind("TCX, from a sports watch", _GPSBABEL),
    "collada": Kind("COLLADA", _TO_MESH),
    "x3d": Kind("X3D", _TO_MESH),
    "vtkfile": _VTK,
    "calibration": _CALIBRATION,  # of Agisoft
    "opencv_storage": _CALIBRATION,
    "sdf": _GAZEBO,
    "robot": _GAZEBO,
    "vrtdataset": Kind("a virtual raster of GDAL", _TO_MAP),
    "osm": Kind("OpenStreetMap XML", "convert its polygons with osmtogeojson, for [[walls]]"),
    "citymodel": Kind("CityGML", "convert it with citygml-tools to-cityjson and cjio to .obj, for "
                      "[[mesh]]"),
    "featurecollection": Kind("GML", _WALLS),
    "svg": Kind("an SVG image", _PICTURE),
    "html": Kind("HTML, a web page instead of the file", "download the file again"),
    "fcd-export": Kind("SUMO XML", "convert it to a table with xml2csv.py, and name its columns"),
    "geometry": Kind("a ground plan in XML", "write it as JSON or WKT, for [[walls]]"),
}  # fmt: skip
_XML = Kind("XML", f"write a ground plan as JSON or WKT, for [[walls]]; {_PEOPLE}, for [[tracks]]")

_GEOMETRIES = (  # geometries of GeoJSON; those from the third on are also in WKT
    "FeatureCollection", "Feature", "GeometryCollection", "Polygon", "MultiPolygon", "LineString",
    "MultiLineString", "Point", "MultiPoint",
)  # fmt: skip
_CURVED = "CurvePolygon", "MultiSurface", "PolyhedralSurface", "Triangle", "TIN"  # only in WKT
_WKT = re.compile(
    rf"\s*(?:SRID\s*=\s*\d+\s*;\s*)?(?:{'|'.join((*_GEOMETRIES[2:], *_CURVED))})"
    r"\s*(?:Z|M|ZM)?\s*(?:\(|EMPTY)",
    re.IGNORECASE,
)
_ANY = msgspec.json.Decoder(float_hook=str)  # accepts numbers that are too large, too

_CONTROL = re.compile(rb"[\0-\x08\x0e-\x1f]")  # bytes that do not occur in texts
_MARKUP = re.compile(rb"\s*(?:<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>\[]*(?:\[.*?\]\s*)?>)", re.DOTALL)
_ELEMENT = re.compile(rb"\s*<(?:[A-Za-z_][\w.-]*:)?([A-Za-z_][\w.-]*)[\s/>]")
_JSON = re.compile(rb"\s*(?:\{\s*[\"}]|\[[\s\[{]*(?:[\"\]}]|-?\d|true\b|false\b|null\b))")
_NMEA = re.compile(rb"\s*\$(?:G[PNLABQ]|BD|P)[A-Z]{3},")
_DXF = re.compile(rb"\s*(?:999\s.*\s)?0\s+SECTION\s")
_MESH_WORDS = re.compile(
    rb"\s*(?:(?P<off>(?:ST)?C?N?OFF(?: BINARY)?)\s|(?P<stl>solid\b[^\n]*\s+facet\b))"
)
_GRID = re.compile(
    rb"\s*(?:ncols\s+\d"
    rb"|(?:(?:nrows|[xy]ll(?:corner|center)|cellsize|nodata_value)[ \t]+[-+.\d]\S*\s+)+ncols\s)",
    re.IGNORECASE,
)
_GRASS = re.compile(rb"\s*(?:(?:north|south|east|west|rows|cols):\s*\S+\s+){6}", re.IGNORECASE)
_PGM_HEADER = re.compile(rb"P[25]\s+(?:#[^\n]*\s+)*\d+\s+\d+\s+\d+\s")
_FRAME_A_LINE = re.compile(rb"\d+:(?:-?[\d.]+,){2,}[-\d.,]+;")
_METRICA = re.compile(rb",,,\s*(?:Home|Away)\s*,", re.IGNORECASE)
_SPLINES = re.compile(rb"\s*\d+\s*-\s*the number of splines", re.IGNORECASE)
_COLMAP = re.compile(
    rb"(?:#[^\n]*\n)*\d+ (?:SIMPLE_PINHOLE|PINHOLE|SIMPLE_RADIAL|RADIAL|OPENCV|OPENCV_FISHEYE|"
    rb"FULL_OPENCV|FOV|SIMPLE_RADIAL_FISHEYE|RADIAL_FISHEYE|THIN_PRISM_FISHEYE) \d+ \d+ "
)
# calibrations of OpenCV, ROS, Kalibr and Pose2Sim
_LENS = re.compile(
    rb"!!opencv-matrix|^camera_matrix:|^distortion_model:|^\s+camera_model:|"
    rb"^(?:distortions|matrix)\s*=\s*\[(?s:.*)^(?:distortions|matrix)\s*=\s*\[",
    re.MULTILINE,
)
_ROS_IMAGE = re.compile(rb"^image:(?s:.*)^resolution:|^resolution:(?s:.*)^image:", re.MULTILINE)


def kind_of(path: Path) -> Kind | None:
    """Returns the kind of a file by its first bytes; None if it is not a known kind.

    A file that cannot be opened has no kind, and its reader reports why. Nor has a pipe, as reading
    it might never end.
    """
    if not os.path.isfile(path):  # unlike Path.is_file, also False for an impossible name
        return None
    try:
        with path.open("rb") as file:
            begin = file.read(BEGIN)
    except (OSError, ValueError):
        return None
    return next((kind for look in _LOOKS if (kind := look(begin))), None)


def kind_of_text(text: str) -> Kind | None:
    """Returns WKT, GEOJSON, CITYJSON or GROUND_PLAN if the whole text is one of them, else None."""
    if _WKT.match(text):
        return WKT
    try:
        content: Any = _ANY.decode(text)
    except (msgspec.MsgspecError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    if content.get("type") == "CityJSON":
        return CITYJSON
    if content.get("type") in _GEOMETRIES:
        return GEOJSON
    is_plan = all(isinstance(plan, dict) and "walkable" in plan for plan in content.values())
    return GROUND_PLAN if content and is_plan else None


def require(path: Path, takes: Collection[Kind] = ()) -> None:
    """Raises ProblemError, naming the kind of a file, if the caller does not read that kind.

    Parameters
    ----------
    takes : kinds that the caller reads; files of unknown kinds are accepted
    """
    kind = kind_of(path)
    if kind is not None and kind not in takes:
        raise ProblemError(f"is {kind.name}; {kind.way_out}")


def _by_bytes(begin: bytes) -> Kind | None:
    marks = _TEXTS if _CONTROL.search(begin) is None else _BINARY | _TEXTS
    for mark, kind in marks.items():
        at, magic = (0, mark) if isinstance(mark, bytes) else mark
        if begin[at : at + len(magic)] == magic:
            return _closer(kind, begin)
    if begin[:1] < b"\t" and begin[1:2] == b"P":  # the number of its parameter block, then 80
        return Kind("C3D, motion capture", f"{_PEOPLE}, from one marker per person, as by ezc3d")
    if _PGM_HEADER.match(begin):
        return _PGM
    if begin[:2] == b"BM" and begin[14:18] in (b"\x28\0\0\0", b"\x7c\0\0\0", b"\x6c\0\0\0"):
        return Kind("a BMP", _PICTURE)
    return None


def _closer(kind: Kind, begin: bytes) -> Kind:
    """Returns the more specific kind of a database or an archive, by its first bytes."""
    if kind is SQLITE:
        if begin[68:70] == b"GP":  # application id in the header: GPKG, GP10
            return _GEOPACKAGE
        return _ROS_2 if re.search(rb"CREATE TABLE\s+topics\b", begin) else SQLITE
    if kind is not _ZIP:
        return kind
    first = begin[30 : 30 + int.from_bytes(begin[26:28], "little")]
    if first.endswith(b".kml"):
        return _KMZ
    if first.endswith(b".npy"):
        return _NPZ
    if first.endswith((b".usdc", b".usda", b".usd", b".model")) or b"3D/" in begin:
        return _MESH_ARCHIVE
    if first.startswith((b"[Content_Types]", b"_rels/", b"xl/", b"docProps/")):
        return _EXCEL
    is_document = first == b"mimetype" and b"opendocument" in begin[38:120]
    return _OPEN_DOCUMENT if is_document else _ZIP


def _by_root(begin: bytes) -> Kind | None:
    """Returns the kind of XML, by its root element."""
    text = _in_utf8(begin)
    if re.match(rb"\s*<!DOCTYPE\s+html\b", text, re.IGNORECASE):
        return _ROOTS["html"]
    at = 0
    while found := _MARKUP.match(text, at):
        at = found.end()
    if root := _ELEMENT.match(text, at):
        return _ROOTS.get(root[1].decode().lower(), _XML)
    return _XML if text.lstrip().startswith((b"<?xml", b"<!DOCTYPE")) else None


_FEATURE = re.compile(rb'"type"\s*:\s*"Feature"')


def _by_words(begin: bytes) -> Kind | None:
    """Returns the kind of a text that begins with characteristic words or braces."""
    text = _in_utf8(begin)
    if _JSON.match(text):
        lines = text.split(b"\n")
        several = len(lines) > 1 and lines[1].lstrip()[:1] == lines[0].lstrip()[:1]
        if not (several and _is_json(lines[0])):
            return JSON
        return _GEOJSON_LINES if _FEATURE.search(lines[0]) else _JSON_LINES
    if _WKT.match(text.decode("utf-8", "replace")):
        return WKT
    if _NMEA.match(text):
        return Kind("NMEA, a GPS receiver's log", _GPSBABEL)
    if _DXF.match(text):
        return Kind("a DXF drawing", _WALLS)
    if _GRID.match(text):
        return ESRI_ASCII
    if _GRASS.match(text):
        return Kind("an ASCII grid of GRASS", "export it with r.out.gdal to .tif, for [map] of a "
                    "recipe")  # fmt: skip
    if _FRAME_A_LINE.match(text):
        return _ROWS_OF_FRAMES
    if _METRICA.match(text):
        return Kind("football data of Metrica Sports", "its positions are shares of the pitch: "
                    f"multiply them by its length and width, and {_PEOPLE}")  # fmt: skip
    if _SPLINES.match(text):
        return Kind("splines of UCY (.vsp), in pixels", f"apply the homography, and {_PEOPLE}")
    if _COLMAP.match(text) or _LENS.search(text):
        return _CALIBRATION
    if _ROS_IMAGE.search(text):
        return _ROS_MAP
    if re.search(rb"^HFDTE", text, re.MULTILINE):
        return Kind("IGC, a glider's log", _GPSBABEL)
    if re.search(rb"^endheader\s*$", text, re.MULTILINE | re.IGNORECASE):
        return Kind("an OpenSim table (MOT or STO)", f"{_PEOPLE}, without its header")
    if mesh := _MESH_WORDS.match(text):
        return OFF if mesh["off"] else STL
    return None


_LOOKS: tuple[Callable[[bytes], Kind | None], ...] = (_by_bytes, _by_root, _by_words)


def _in_utf8(begin: bytes) -> bytes:
    """Returns the beginning of a text in UTF-8, without a byte order mark."""
    if begin.startswith((b"\xff\xfe", b"\xfe\xff")):
        return begin.decode("utf-16", "replace").encode()
    return begin.removeprefix(b"\xef\xbb\xbf")


def _is_json(line: bytes) -> bool:
    try:
        msgspec.json.decode(line)
    except (msgspec.MsgspecError, RecursionError):
        return False
    return True
