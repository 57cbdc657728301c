"""Files of loads as recorders and spreadsheets write them."""

import numpy as np
import pytest

from parsolid.scene.csv_tables import Table, read_csv_table
from parsolid.scene.load_histories import FactorHistory

ROWS = "0,0\r\n1e-3,2\r\n"


SAME = [ROWS, "t,a\r\n" + ROWS, "\ufefft, a\n0, 0\n\n1e-3, 2\n\n\n", ROWS + ",\n", "\n \n" + ROWS, "# t, a\n" + ROWS]
SAME += [" 0 , 0 \n 1E-3 , 2. \n", '"0","0"\n"1e-3","2"\n', "0,0,9\n1e-3,2,9\n"]


@pytest.mark.parametrize("text", SAME)
def test_a_table_and_a_history_read_the_same_file(tmp_path, text):
    path = tmp_path / "push.csv"
    path.write_bytes(text.encode())
    places, values = read_csv_table(str(path))
    assert (places.tolist(), values.tolist()) == ([0.0, 1e-3], [0.0, 2.0])
    assert Table(str(path)).at(np.array([5e-4])) == [1.0]
    assert FactorHistory(file=str(path)).factor(5e-4) == 1.0


@pytest.mark.parametrize(
    "text, line",
    [
        ("t,a\n0,0\n1;2\n", "line 3"),
        ("0,0\n1,nan\n", "line 2"),
        ("0,0\n\n1\n", "line 3"),
        # a row without its value is no line of names
        ("0,\n1,2\n", "line 1"),
        ("0,--\n1,2\n", "line 1"),
    ],
)
def test_a_fault_is_told_with_its_line(tmp_path, text, line):
    path = tmp_path / "push.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=line):
        read_csv_table(str(path))


def test_a_column_is_chosen_by_its_name(tmp_path):
    path = tmp_path / "push.csv"
    path.write_text("t,a,b\n0,1,2\n1,3,4\n")
    assert read_csv_table(str(path), "b")[1].tolist() == [2.0, 4.0]
    with pytest.raises(ValueError, match="c"):
        read_csv_table(str(path), "c")
