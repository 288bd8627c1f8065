"""Published tables beside ours: what must agree agrees, what cannot is marked, and the page says so."""

import json

import numpy as np
import pytest

from ulna import _dyck2013, _published, validate
from ulna.cli import main


@pytest.fixture(scope="module")
def found():
    return validate.impedance()


def test_tables_that_follow_from_other_tables_are_reproduced(found):
    for number, count in (("3.3", 54), ("3.5", 18), ("4.1a", 6), ("4.2a", 3), ("5.4", 40)):
        table = found[number]
        assert table.status == "reproduced"
        assert (table.agreeing, len(table.comparisons)) == (count, count)


def test_simulated_recordings_give_the_tables_back(found):
    counts = {"3.1": 48, "3.2": 72, "3.4": 24, "4.3": 6, "5.1": 40, "5.6": 24, "A.1": 5}
    for number, count in counts.items():
        table = found[number]
        assert table.status == "recovered", [item for item in table.comparisons if not item.agrees]
        assert len(table.comparisons) == count
    # 2 % and 5 % as promised on the page, and no number is the printed one itself.
    for item in found["3.2"].comparisons:
        share = 0.02 if item.quantity in ("xx", "yy") else 0.05
        assert item.tolerance == pytest.approx(share * abs(item.published))
        assert item.ours != item.published


def test_what_the_simulated_rigid_arm_does_not_show_is_said(found):
    table = found["4.3a"]
    assert [item.agrees for item in table.comparisons] == [False, True]
    assert table.status == "not recovered"


def test_the_excess_does_not_follow_and_says_why(found):
    table = found["3.6"]
    assert table.status == "does not follow"
    assert table.agreeing == 0
    # Smallest eigenvalues of the symmetric parts of B, by hand from Tables 3.2 and 3.4.
    ours = [item.ours for item in table.comparisons]
    assert ours == pytest.approx([4.924, 4.361, 4.236, 3.162, 4.010, 2.839, 8.578, 4.102], abs=1e-3)
    assert "above b_xx" in " ".join(table.remarks)


def test_the_thesis_own_threshold_decides_against_two_of_its_verdicts(found):
    wrong = [
        (number, item.row)
        for number in ("3.2a", "3.4a")
        for item in found[number].comparisons
        if not item.agrees
    ]
    assert wrong == [("3.2a", "P6"), ("3.4a", "P1")]
    assert "16.4 %" in " ".join(found["3.2a"].remarks)


def test_rounding_is_the_furthest_that_printed_digits_allow():
    # A product: |y| h + |x| h exactly to first order.
    def product(x):
        return x[0] * x[1]

    assert _published.rounding(product, np.array([3.0, -5.0]), 0.01) == pytest.approx(0.08)


def test_a_comparison_can_disagree():
    assert _published.compare("row", "A", "", 5.1, 5.14, 0.05).agrees
    assert not _published.compare("row", "A", "", 5.1, 5.16, 0.05).agrees
    assert not _published.compare_words("row", "verdict", "passive", "not passive").agrees


def test_every_table_has_a_reason(found):
    assert all(table.remarks for table in found.tables)
    with pytest.raises(KeyError, match="there is no table '9.9'"):
        found["9.9"]


def test_page_and_json_hold_every_number(found, tmp_path):
    page = found.write(tmp_path / "deep" / "page.html").read_text(encoding="utf-8")
    for table in found.tables:
        assert f'id="t{table.number}"' in page
    assert page.count("✗") == 1 + sum(len(t.comparisons) - t.agreeing for t in found.tables)
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [t["number"] for t in told["tables"]] == [t.number for t in found.tables]


def test_command(capsys, tmp_path):
    assert main(["validate", "impedance", "--out", str(tmp_path / "v")]) == 0
    assert "Table 3.6" in capsys.readouterr().out
    assert (tmp_path / "v" / "impedance.html").is_file()
    assert main(["validate", "impedance", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["document"] == "Dyck (2013)"
    assert main(["validate", "legs"]) == 2
    (tmp_path / "file").write_text("")
    assert main(["validate", "impedance", "--out", str(tmp_path / "file")]) == 2


def test_published_arms_are_whole():
    arms = _dyck2013.arms
    assert [len(arms(t)) for t in ("3.2", "3.4", "4.1", "4.2", "5.6")] == [6, 2, 6, 3, 2]
    arm = arms("3.2")["P1"]
    assert arm.m.shape == arm.b.shape == arm.k.shape == (2, 2)
    assert arm.k[1, 0] == -23.02
    assert arm.x0_m == pytest.approx([-0.003, 0.529])
