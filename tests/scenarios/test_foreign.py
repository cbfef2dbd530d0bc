"""Files of other kinds are recognised by their first bytes, wherever a user names a file."""

import gzip
import io
import sqlite3
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.kinds import (
    ESRI_ASCII,
    GLB,
    GPX,
    JSON,
    NUMPY,
    OFF,
    PLY,
    SQLITE,
    STL,
    TIFF,
    WKT,
    kind_of,
)

HEAD = "steps = 2\n[map]\nsize = [20, 20]\n"
DRONES = '[[drones]]\ncount = 1\ncamera = "dji-mavic-pro"\nmotion = { layers = [6] }\n'


def zipped(name: str, content: bytes = b"x") -> bytes:
    """An archive of one file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr(name, content)
    return packed.getvalue()


def picture(kind: str) -> bytes:
    """An image of one pixel."""
    written = io.BytesIO()
    Image.new("RGB", (1, 1)).save(written, kind)
    return written.getvalue()


def array() -> bytes:
    """An array as NumPy saves it."""
    written = io.BytesIO()
    np.save(written, np.zeros((2, 2)))
    return written.getvalue()


def arrays() -> bytes:
    """Arrays as NumPy saves them."""
    written = io.BytesIO()
    np.savez(written, a=np.zeros(2))
    return written.getvalue()


def table(kind: str) -> bytes:
    """A table as pandas writes it."""
    written = io.BytesIO()
    frame = pd.DataFrame({"id": [1], "x": [2.0]})
    frame.to_parquet(written) if kind == "parquet" else frame.to_feather(written)
    return written.getvalue()


def database(folder: Path, *statements: str) -> bytes:
    """An SQLite database."""
    path = folder / "made.db"
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()
    return path.read_bytes()


KINDS: list[tuple[bytes | Callable[[], bytes], str]] = [
    (lambda: picture("png"), "a PNG"),
    (lambda: picture("jpeg"), "a JPEG"),
    (lambda: picture("gif"), "a GIF"),
    (lambda: picture("bmp"), "a BMP"),
    (lambda: picture("webp"), "a WebP"),
    (array, "a NumPy array"),
    (arrays, "an archive of NumPy arrays"),
    (lambda: table("parquet"), "Parquet"),
    (lambda: table("feather"), "an Arrow or Feather file"),
    (lambda: zipped("a.txt"), "a ZIP archive"),
    (lambda: zipped("doc.kml"), "a KMZ"),
    (lambda: zipped("[Content_Types].xml"), "an Excel or other Office file"),
    (lambda: zipped("mimetype", b"application/vnd.oasis.opendocument.spreadsheet"),
     "an OpenDocument file"),
    (lambda: zipped("3D/3dmodel.model"), "a 3MF or USDZ"),
    (b"\0\1\0\0Standard ACE DB\0", "an Access database"),
    (bytes(8) + b"DUCK" + bytes(9), "a DuckDB database"),
    (b"-- MySQL dump 10.13\n", "a MySQL dump"),
    (b"{\\rtf1\\ansi", "rich text"),
    (lambda: gzip.compress(b"id,frame,x,y\n"), "compressed with gzip"),
    (b"\x89HDF\r\n\x1a\n" + bytes(20), "HDF5"),
    (b"CDF\x01" + bytes(20), "NetCDF"),
    (b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "a MATLAB file"),
    (b"%PDF-1.7\n", "a PDF"),
    (b"#ROSBAG V2.0\n", "a ROS bag"),
    (b"\x89MCAP0\r\n" + bytes(9), "an MCAP bag"),
    (b"\xd4\xc3\xb2\xa1" + bytes(20), "a network capture"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(9), "an old Excel"),
    (b"LASF" + bytes(20), "a point cloud"),
    (b"\x02\x50" + bytes(20), "C3D"),
    (b"\x80\x04\x95" + bytes(20), "a Python pickle"),
    (b"\x0e\x10\x43\x08\x28\x06\0\0.FIT", "FIT"),
    (b"ULog\x01\x12\x35\x01" + bytes(9), "a PX4 log"),
    (b"\0\0\0\x18ftypmp42", "a video"),
    (b"Kaydara FBX Binary  \0", "an FBX"),
    (b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC4'));", "STEP or IFC"),
    (b"PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\n", "TRC"),
    (b"HIERARCHY\nROOT Hips\n{\n", "BVH"),
    (b"Format Version,1.23,Take Name,Take 1\n", "a CSV file of OptiTrack"),
    (b"$GPGGA,100000,5224.06,N,01303.54,E,1,8,1,35,M,,M,,\n", "NMEA"),
    (b"AXXX\nHFDTE010526\n", "IGC"),
    (b"  0\nSECTION\n  2\nHEADER\n", "a DXF drawing"),
    (b'{"scene": {"id": 1}}\n{"track": {"f": 0, "p": 1, "x": 2.0, "y": 2.0}}\n', "JSON lines"),
    (b"[0, 1, 2.0, 2.0]\n[1, 1, 2.1, 2.0]\n", "JSON lines"),
    (b"<?xml version='1.0'?>\n<!-- a <kml> -->\n<kml xmlns='http://www.opengis.net/kml/2.2'/>",
     "KML"),
    (b'\xef\xbb\xbf<?xml version="1.0"?><k:kml xmlns:k="u"></k:kml>', "KML"),
    ('\ufeff<?xml version="1.0" encoding="utf-16"?><kml/>'.encode("utf-16-le"), "KML"),
    (b"<TrainingCenterDatabase>", "TCX"),
    (b"<COLLADA version='1.4'>", "COLLADA"),
    (b"<osm version='0.6'>", "OpenStreetMap XML"),
    (b'<!DOCTYPE html>\n<html lang="en">', "HTML, a web page"),
    (b"<html><body>404", "HTML, a web page"),
    (b'<?xml version="1.0"?><!DOCTYPE trajectories [<!ENTITY a "b">]><trajectories a="1">', "XML"),
    (b"<dataset name='walk'>\n<frame number='0'>", "XML"),
    (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "a Git LFS pointer"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "name"), KINDS, ids=[name for _, name in KINDS])
def test_a_foreign_file_is_named_wherever_it_stands(
    tmp_path: Path, content: bytes | Callable[[], bytes], name: str
) -> None:
    """Its suffix says nothing: tracks, walls, meshes, maps and scenes name it, with a way out."""
    content = content if isinstance(content, bytes) else content()
    tables = {
        "f.csv": f'{HEAD}{DRONES}[[tracks]]\nfile = "f.csv"\ncount = 1\n',
        "f.json": f'{HEAD}{DRONES}[[walls]]\nfile = "f.json"\n',
        "f.obj": f'{HEAD}{DRONES}[[mesh]]\nfile = "f.obj"\n',
        "f.asc": f'steps = 2\n{DRONES}[map]\nfile = "f.asc"\n',
        "f.tif": f'steps = 2\n{DRONES}[map]\nfile = "f.tif"\n',
        "f.dae": f'{HEAD}{DRONES}[[mesh]]\nfile = "f.dae"\n',
    }
    for file, recipe in tables.items():
        (tmp_path / file).write_bytes(content)
        (tmp_path / "scene.toml").write_text(recipe)
        with pytest.raises((ProblemError, FileError)) as error:
            load_scene(str(tmp_path / "scene.toml"))
        message = str(error.value)
        assert f"{file}: is {name}" in message and "; " in message.split(f"is {name}")[1]
        assert "\n" not in message
    for file in ("f.any", "g.toml", "g.yaml", "g.scen", "g.json"):
        (tmp_path / file).write_bytes(content)
        with pytest.raises(FileError, match=rf"{file}: is (not a scene, but )?{name}"):
            load_scene(str(tmp_path / file))
    (tmp_path / "f.any").unlink()


def test_databases_are_told_apart(tmp_path: Path) -> None:
    """A GeoPackage has its number in the header, a bag of ROS 2 its tables."""
    for statements, name in (
        (("create table trajectory_data (id, frame)",), SQLITE.name),
        (("pragma application_id = 1196444487", "create table gpkg_contents (a)"), "a GeoPackage"),
        (("CREATE TABLE topics(id INTEGER)", "CREATE TABLE messages(a)"), "a ROS 2 bag"),
    ):
        path = tmp_path / "some"
        path.write_bytes(database(tmp_path, *statements))
        (tmp_path / "made.db").unlink()
        kind = kind_of(path)
        assert kind is not None and kind.name == name


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"II*\0" + bytes(9), TIFF),
        (b"MM\0+" + bytes(9), TIFF),
        (b"ncols 4\nnrows 3\n", ESRI_ASCII),
        (b"NCOLS  4\r\n", ESRI_ASCII),
        (b"glTF\x02\0\0\0", GLB),
        (b"ply\nformat ascii 1.0\n", PLY),
        (b"OFF\n3 1 0\n", OFF),
        (b"OFF 3 1 0\n", OFF),
        (b"solid box\n  facet normal 0 0 1\n", STL),
        (array(), NUMPY),
        (b'{"asset": {"version": "2.0"}}', JSON),
        (b'{\n  "a": 1\n}', JSON),
        (b'[[1, 2],\n [3, 4]]', JSON),
        (b"POLYGON ((0 0, 1 0, 1 1, 0 0))", WKT),
        (b'<?xml version="1.0"?><gpx version="1.1">', GPX),
        (b'<g:gpx xmlns:g="http://www.topografix.com/GPX/1/0">', GPX),
    ],
)  # fmt: skip
def test_kinds_that_are_read_are_known_too(tmp_path: Path, content: bytes, kind: object) -> None:
    """So that a map that is named as tracks is told where it belongs."""
    (tmp_path / "some").write_bytes(content)
    assert kind_of(tmp_path / "some") is kind


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"id,frame,x,y\n1,0,1,2\n",
        b"# framerate: 25\n1 0 1 2\n",
        b"1 0 1.0 2.0\n",
        b"0 1 2 3\nSECTION\n",
        b"v 0 0 0\nf 1 2 3\n",
        b"o house\n",
        b"solid,id,x,y\n1,1,1,1\n",
        b"[map]\nsize = [1, 2]\n",
        b"[[tracks]]\n",
        b"version 1\n0\tm.map\n",
        b"type octile\n",
        b"planner:\n  world:\n",
        b"{planner: {world: 1}}",
        "id;frame;x;y\nzo\u00eb;0;1;2\n".encode("utf-16"),
        b"PROJCS[\"WGS 84 / UTM zone 33N\"",
        b"point_id,x,y\n",
        b"name,GRIB,CDF\n",
        b"PAR1,0,1.0,2.0\n",
        b"ORC1;0;1;2\n",
        b"AC10 0 1 2\n",
        b"GRIB\t0\t1\t2\n",
        b"BLENDER 0 1 2\n",
        b"MATLAB 0 1 2\n",
        b"DSAA 0 1 2\n",
        b"0 1 2.0 DUCK\n",
        b"< 1 2 3\n",
    ],
)  # fmt: skip
def test_plain_text_is_of_no_known_kind(tmp_path: Path, content: bytes) -> None:
    """Tables, recipes and maps in text are left to those who read them, whatever ids are called."""
    (tmp_path / "some").write_bytes(content)
    assert kind_of(tmp_path / "some") is None
    assert kind_of(tmp_path) is None
    assert kind_of(tmp_path / "none") is None
