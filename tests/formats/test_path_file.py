"""Paths in files of other programs."""

import json
from pathlib import Path

import numpy as np
import pytest

from brrt import BrrtError
from brrt.formats import path_file
from brrt.formats.path_file import read_path

NAMES = ("x", "y", "theta")
ROWS = [[1.0, 2.0, 0.5], [3.0, 4.5, -0.25]]

TEXTS = {
    "order.csv": "1,2,0.5\n3,4.5,-0.25\n",
    "header.csv": "x,y,theta\n1,2,0.5\n3,4.5,-0.25\n",
    "other order.csv": "t,Yaw, X ,y\n0,0.5,1,2\n1,-0.25,3,4.5\n",
    "quoted.csv": '"x";"y";"heading"\r\n1;2;0.5\r\n3;4.5;-0.25\r\n',
    "trailing.csv": "q1,q2,q3,\n1,2,5e-1,\n3,4.5,-0.25,\n\n",
    "export.csv": "seq,waypoint,q_x,q_y,q_theta\n7,0,1,2,0.5\n7,1,3,4.5,-0.25\n",
    "tabs.tsv": "x\ty\ttheta\n1\t2\t0.5\n3\t4.5\t-0.25\n",
    "ompl.txt": "1 2 0.5 \n3 4.5 -0.25 \n\n",
    "numpy.txt": "# theta x y\n5e-1 1 2\n# a remark\n-0.25 3 4.5\n",
    "bom.csv": "\ufeffx,y,theta\n1,2,0.5\n3,4.5,-0.25\n",
    "rows.json": json.dumps(ROWS),
    "objects.json": json.dumps([dict(zip(NAMES, row, strict=True)) for row in ROWS]),
    "inside.json": json.dumps({"waypoints": ROWS, "cost": 3}),
}


@pytest.mark.parametrize("name", TEXTS)
def test_columns_by_name_or_order(name: str, tmp_path: Path) -> None:
    """All say the same."""
    (tmp_path / name).write_text(TEXTS[name], encoding="utf-8")
    assert read_path(tmp_path / name, NAMES).tolist() == ROWS


def test_arrays(tmp_path: Path) -> None:
    """Rows of any real type, in either order in memory, or with named fields."""
    path = tmp_path / "p.npy"
    fields = np.array([(0.5, 1, 2), (-0.25, 3, 4.5)], [("yaw", "f8"), ("x", "i4"), ("y", "f4")])
    for array in (np.array(ROWS), np.asfortranarray(ROWS), np.array(ROWS, ">f4"), fields):
        np.save(path, array)
        assert read_path(path, NAMES).tolist() == ROWS


BAD = {
    "a.csv": ("1,2,3\n1,two,3\n", "a.csv:2: column 2, y: 'two' is not a finite number"),
    "b.csv": ("x,y,theta\n1,2,nan\n", "b.csv:2: column 3, theta: 'nan' is not"),
    "c.csv": ("1,2\n", "c.csv:1: 2 columns; without a header that names them a row has 3: x, y"),
    "d.csv": ("x,y,t\n1,2,3\n", "d.csv:1: no column 'theta' among x, y, t; name the columns x,"),
    "e.csv": ("x,y,theta\n1,2,3\n1,2\n", "e.csv:3: the row ends before column 3, theta"),
    "f.csv": ("x,y,theta\n", "f.csv: no waypoint"),
    "g.csv": ("", "g.csv: no waypoint"),
    "h.csv": ("x,x,y,theta\n1,2,3,4\n", "h.csv:1: two columns are called 'x'"),
    "i.csv": ("1_0,2,3\n", "i.csv:1: column 1, x: '1_0' is not"),
    "j.csv": ("1e200,2,3\n", "column 1, x: '1e200' is not a finite number"),
    "k.csv": ("1,5;2,5;3\n", "column 1, x: '1,5' is not a finite number; write one such as 1.5"),
    "l.csv": ("1,2,3\n" + "9" * 20000 + "\n", "l.csv:2: 20,000 characters"),
    "m.csv": ("1,2,3\0", "m.csv: not a text file"),
    "a.json": ("[[1, 2, 3], [1, 2]]", "a.json: waypoint 1: must be 3 numbers: x, y, theta"),
    "b.json": ('[{"x": 1, "y": 2}]', "b.json: waypoint 0: no column 'theta' among x, y"),
    "c.json": ("[[1, 2, true]]", "c.json: waypoint 0: theta: True is not a finite number"),
    "d.json": ("[[1, 2, NaN]]", "d.json: waypoint 0: theta: nan is not"),
    "e.json": ('{"x": [1, 2]}', "e.json: must be a list of waypoints"),
    "f.json": ("[1", "f.json: not a JSON path"),
    "g.json": ("[[1, 2, " + "9" * 400 + "]]", "theta: 9999"),
    "a.npy": ("no array", "a.npy: not an array of numbers"),
    "a.pkl": ("", "a.pkl: a path is a .csv, .txt, .json or .npy file"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files(name: str, tmp_path: Path) -> None:
    """One line with file, row, column, value and remedy."""
    (tmp_path / name).write_text(BAD[name][0])
    with pytest.raises(BrrtError) as raised:
        read_path(tmp_path / name, NAMES)
    assert BAD[name][1] in str(raised.value)
    assert "\n" not in str(raised.value)


def test_bad_arrays(tmp_path: Path) -> None:
    """Python objects are never loaded, and no memory is taken for what a header states."""
    path = tmp_path / "p.npy"
    for array, text in (
        (np.array([[1, 2, None]]), "not an array of numbers"),
        (np.zeros((2, 2)), "must be numbers of shape (n, 3): x, y, theta; it is float64 of shape"),
        (np.zeros(3), "must be numbers of shape (n, 3)"),
        (np.zeros((1, 3), complex), "it is complex128"),
        (np.array([[1, np.inf, 0]]), "waypoint 0: y: inf is not a finite number"),
        (np.zeros(2, [("x", "f8")]), "no column 'y' among x"),
        (np.zeros(2, [("x", "f8"), ("y", "f8"), ("yaw", "S3")]), "must be numbers"),
        (np.zeros((0, 3)), "no waypoint"),
    ):
        np.save(path, array)
        with pytest.raises(BrrtError) as raised:
            read_path(path, NAMES)
        assert text in str(raised.value)
    np.save(path, np.zeros((2, 3)))
    data = path.read_bytes()
    for shape in (b"(9999999999999999, 3), }", b"(-2, 3), }"):
        path.write_bytes(data.replace(b"(2, 3), }" + b" " * (len(shape) - 9), shape))
        with pytest.raises(BrrtError, match=r"not an array of numbers|must be numbers"):
            read_path(path, NAMES)


def test_too_many_waypoints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are refused with the greatest number."""
    monkeypatch.setattr(path_file, "MOST_WAYPOINTS", 1)
    np.save(tmp_path / "p.npy", np.array(ROWS))
    for name in ("order.csv", "rows.json"):
        (tmp_path / name).write_text(TEXTS[name])
    for name in ("order.csv", "rows.json", "p.npy"):
        with pytest.raises(BrrtError, match="more than 1 waypoints; judge it in parts"):
            read_path(tmp_path / name, NAMES)
