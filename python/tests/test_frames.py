"""Files of frames."""

import numpy as np
import pytest
import taxel

COUNTS = np.arange(12, dtype=np.uint16).reshape(2, 2, 3)
TIMES = np.array([0, 2**60 + 1], np.uint64)
ANGLES = np.array([[0.25], [np.nan]], np.float32)
HEADER = "t_ns,0B0X,0B0Y,0B0Z,0B1X,0B1Y,0B1Z"


def check(frames, joints):
    assert len(frames) == 2 and frames.counts.dtype == np.uint16
    assert frames.counts.tolist() == COUNTS.tolist()
    assert frames.t_ns.tolist() == TIMES.tolist()
    np.testing.assert_array_equal(frames.joints, joints)
    assert frames.without_value.tolist() == [[False] * 2] * 2


def test_taxels_of_images_are_listed_row_by_row(tmp_path):
    counts = np.arange(36, dtype=np.uint16).reshape(2, 2, 3, 3)
    for more in ({}, {"without_value": np.arange(12).reshape(2, 6) == 7}):
        np.savez(tmp_path / "a.npz", counts=counts, t_ns=TIMES, **more)
        frames = taxel.load_frames(tmp_path / "a.npz")
        assert frames.counts.tolist() == counts.reshape(2, 6, 3).tolist()
        assert frames.without_value.sum() == len(more)


@pytest.mark.parametrize("joints", [ANGLES, np.zeros((2, 0), np.float32)])
def test_arrays_and_columns_of_convert_are_the_same_frames(tmp_path, joints):
    angles = {"joints": joints} if joints.size else {}
    np.savez(tmp_path / "a.npz", counts=COUNTS, t_ns=TIMES, **angles)
    check(taxel.load_frames(tmp_path / "a.npz"), joints)
    rows = [[time, *counts.ravel(), *angle] for time, counts, angle in zip(TIMES, COUNTS, joints)]
    header = HEADER + ",J0" * len(angles)
    (tmp_path / "a.csv").write_text("\n".join([header, *(",".join(map(str, row)) for row in rows), ""]))
    check(taxel.load_frames(tmp_path / "a.csv"), joints)


def test_a_taxel_without_a_value_is_told_from_one_that_reads_0(tmp_path):
    without = np.array([[False, True], [True, False]])
    counts = np.where(without[..., None], 0, COUNTS).astype(np.uint16)
    counts[0, 0] = 0
    np.savez(tmp_path / "a.npz", counts=counts, t_ns=TIMES, joints=ANGLES, without_value=without)
    (tmp_path / "a.csv").write_text(f"{HEADER},J0\n0,0,0,0,,,,0.25\n{TIMES[1]},,,,9,10,11,NaN\n")
    (tmp_path / "last.csv").write_text(f"{HEADER}\n0,0,0,0,,,\r\n{TIMES[1]},,,,9,10,11")
    for name, joints in [("a.npz", ANGLES), ("a.csv", ANGLES), ("last.csv", np.zeros((2, 0), np.float32))]:
        frames = taxel.load_frames(tmp_path / name)
        assert frames.without_value.dtype == np.bool_ and frames.without_value.tolist() == without.tolist(), name
        assert frames.counts.dtype == np.uint16 and frames.counts.tolist() == counts.tolist(), name
        np.testing.assert_array_equal(frames.joints, joints)
        assert frames.t_ns.tolist() == TIMES.tolist(), name


def test_no_frames_are_frames(tmp_path):
    (tmp_path / "a.csv").write_text(HEADER + "\n")
    assert taxel.load_frames(tmp_path / "a.csv").counts.shape == (0, 2, 3)


def test_a_table_that_another_program_saved_anew_is_the_same_frames(tmp_path):
    names = ",".join(f'"{name}"' for name in HEADER.split(","))
    text = f"{names}\r\n0.0,0.0,1.0,2.0,3.0,4.0,5.0\r\n{TIMES[1]}.0,6,7,8,9,10,11\r\n"
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    check(taxel.load_frames(tmp_path / "a.csv"), np.zeros((2, 0), np.float32))


def test_cells_in_quotes_are_what_is_in_the_quotes(tmp_path):
    lines = [f"{HEADER},J0", '0,,,,3,4,5,0.25', f"{TIMES[1]},6,7,8,9,10,11,-1.5"]
    quoted = "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in lines)
    (tmp_path / "a.csv").write_text(quoted)
    frames = taxel.load_frames(tmp_path / "a.csv")
    assert frames.t_ns.tolist() == [0, TIMES[1]]
    assert frames.counts.tolist() == [[[0, 0, 0], [3, 4, 5]], [[6, 7, 8], [9, 10, 11]]]
    assert frames.without_value.tolist() == [[True, False], [False, False]]
    assert frames.joints.tolist() == [[0.25], [-1.5]]
    (tmp_path / "a.csv").write_text(HEADER + '\n0,"1,5",2,3,4,5,6\n')
    with pytest.raises(ValueError, match="a.csv: no frames as"):
        taxel.load_frames(tmp_path / "a.csv")


def test_what_makes_frames_is_advised_where_it_does(tmp_path):
    for name, advised in [("a.mcap", True), ("a.log", True), ("a.parquet", False), ("a.csv.gz", False)]:
        with pytest.raises(ValueError, match="frames are read from .npz and .csv") as error:
            taxel.load_frames(tmp_path / name)
        assert ("taxel convert" in str(error.value)) == advised, name


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "its columns are not"),
        ("t_ns,y0x0,y0x1,y0x2\n0,1,2,3\n", "its columns are not"),
        ("t_ns,0B0X,0B0Y\n0,1,2\n", "its columns are not"),
        (HEADER + "\n0,1,2,3\n", ""),
        (HEADER + "\nnow,1,2,3,4,5,6\n", "now"),
        (HEADER + "\n0,1,2,3,4,,6\n", "frame 0, column 0B1Y is nan"),
        (HEADER + "\n0,1,2,3,4,5,65536\n", "frame 0, column 0B1Z is 65536"),
        (HEADER + "\n0,1.5,2,3,4,5,6\n", "frame 0, column 0B0X is 1.5"),
    ],
)
def test_columns_that_are_no_frames_are_refused(tmp_path, text, why):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(ValueError, match=f"a.csv: no frames as .*{why}"):
        taxel.load_frames(tmp_path / "a.csv")


def test_arrays_that_do_not_fit_together_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", counts=COUNTS, t_ns=TIMES[:1])
    with pytest.raises(ValueError, match="a.npz: no frames .*1 times"):
        taxel.load_frames(tmp_path / "a.npz")


def test_without_value_of_other_taxels_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", counts=COUNTS, t_ns=TIMES, without_value=np.zeros((2, 3), bool))
    with pytest.raises(ValueError, match=r"a.npz: no frames .*without_value of shape \(2, 3\)"):
        taxel.load_frames(tmp_path / "a.npz")


def test_what_reads_another_file_is_said(tmp_path):
    np.savez(tmp_path / "frames.npz", counts=COUNTS, t_ns=TIMES)
    for name, advice in [
        ("frames.npz", "taxel.load_frames"),
        ("frames.csv", "taxel.load_frames"),
        ("grasp.mcap", "mcap-ros2-support"),
    ]:
        with pytest.raises(ValueError, match=f"{name}: .*{advice}"):
            taxel.load(tmp_path / name)
    with pytest.raises(ValueError, match="grasp.mcap: .*taxel convert"):
        taxel.load_frames(tmp_path / "grasp.mcap")
