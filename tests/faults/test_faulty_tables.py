"""Tables and licence files with a planted fault: one file is one reason with its line; the others are processed."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.actuators.adapted_robot import adapt, read_actuators, write_adapted_robot
from pipeline.actuators.folder import calibrate_folder
from pipeline.actuators.motor_table import read_motors
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.standing import read_standing_pose
from pipeline.batch import Store
from pipeline.errors import FileError, SettingsError
from pipeline.files import settings
from pipeline.readers import Source, content_digest
from pipeline.robot import load_robot
from pipeline.robot.robot_error import RobotError
from pipeline.selection import Curation

ROOT = Path(__file__).resolve().parents[2]
LONG = "y" * 140_000
STRANGE_NUMBERS = ["1:30", "0x10", "010", "1_0", "0o7", "0b1", "\uff11\uff12", "\u0661", ".inf", ".nan", "1e", "--1"]


@pytest.fixture
def source(tmp_path: Path) -> Source:
    """A folder with two motions."""
    for name in "ab":
        (tmp_path / f"{name}.bvh").write_text("HIERARCHY")
    return Source(name="mine", folder=tmp_path)


@pytest.mark.parametrize("row", [f"b.bvh,MIT,{LONG}", f'b.bvh,MIT,"{LONG}'], ids=["long field", "quote without end"])
def test_an_index_with_a_bad_row_licenses_what_comes_before_it(source, tmp_path, row):
    (tmp_path / "index.csv").write_text(f"file,licence,notes\nb.bvh,CC0-1.0,\n{row}\na.bvh,CC0-1.0,z\n")
    first, second = tmp_path / "a.bvh", tmp_path / "b.bvh"
    assert (source.licence_of(first), source.licence_of(second)) == ("unknown", "CC0-1.0")
    (note,) = source.notes_of(first)
    assert note.code == "broken_index" and "index.csv" in note.text and "field" in note.text
    assert source.notes_of(second) == ()
    before = content_digest(first, source)
    (tmp_path / "index.csv").write_text("file,licence\na.bvh,MIT\n")
    assert source.licence_of(first) == "MIT"
    assert source.notes_of(first) == ()
    assert content_digest(first, source) != before


def test_files_of_holes_are_not_read_into_memory(source, tmp_path):
    for name in ("LICENSE", "index.csv"):
        with (tmp_path / name).open("wb") as stream:
            stream.truncate(3_000_000_000)
    script = (
        "from pathlib import Path; from pipeline.readers import Source\n"
        f"source = Source(name='mine', folder=Path({str(tmp_path)!r})); path = source.folder / 'a.bvh'\n"
        "print(source.licence_of(path)); print(source.notes_of(path)[0].text)\n"
        "status = Path('/proc/self/status').read_text().splitlines()\n"  # ru_maxrss begins with the parent's
        "print(int(next(line for line in status if line.startswith('VmHWM')).split()[1]) // 1024)"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60)
    licence, note, peak_mb = done.stdout.splitlines()
    assert licence == "unknown"
    assert "index.csv: it has more than the 20000000 bytes allowed" in note
    assert int(peak_mb) < 500


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    """The project's folder of measurements."""
    return Path(shutil.copytree(ROOT / "data/actuators/t1", tmp_path / "t1"))


ACTUATORS = settings.read(ROOT / "data/actuators.yaml", ActuatorSettings)


def test_a_motor_table_that_is_no_utf8_is_named_with_its_line(measured):
    path = measured / "motors.csv"
    path.write_bytes(b"# made by hand\n# \xb1 2 %\n" + path.read_bytes())
    with pytest.raises(FileError, match=r"motors\.csv, line 2: the byte 0xb1 is no UTF-8 text"):
        read_motors(path, ACTUATORS.model)


def test_a_motor_table_with_a_long_field_is_named_with_its_line(measured):
    path = measured / "motors.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, f"{LONG},a,b,1,1,1,x"]) + "\n")
    with pytest.raises(FileError, match=rf"motors\.csv, line {len(lines) + 1}: the row can't be read"):
        read_motors(path, ACTUATORS.model)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_text(path.read_text() + f"knee,positive,{LONG},1,1,1\n"),
        lambda path: path.write_text(path.read_text() + "z" * 200_000 + "\n"),
        lambda path: path.write_bytes(path.read_bytes() + b"knee,positive,1,1,1,\xb1\n"),
        lambda path: path.write_bytes(b""),
        lambda path: path.open("r+b").truncate(3_000_000_000),
    ],
    ids=["long field", "long line", "latin-1", "empty", "holes"],
)
def test_a_faulty_sweep_is_one_motor_refused(measured, tmp_path, spoil):
    spoil(measured / "knee.csv")
    found = calibrate_folder(measured, ACTUATORS, "1", Store(root=tmp_path / "store"))
    refused = [each.motor for each in found.calibrations if not each.accepted]
    assert refused == ["knee"]
    assert len(found.calibrations) > 1


def test_a_table_of_a_robot_that_is_no_utf8_is_named_with_its_line(tmp_path):
    folder = robot_folder(tmp_path)
    path = folder / "joints.csv"
    path.write_bytes(path.read_bytes() + b"\xe9\n")
    line = path.read_bytes().count(b"\n")
    with pytest.raises(RobotError, match=rf"joints\.csv, line {line}: the byte 0xe9 is no UTF-8 text"):
        load_robot(folder)


def robot_folder(tmp_path: Path) -> Path:
    """A copy of the robot without its policies."""
    return Path(shutil.copytree(ROOT / "robots/t1", tmp_path / "robots/t1", ignore=shutil.ignore_patterns("policies")))


@pytest.mark.parametrize("name", ["t1.xml", "t1.urdf"])
def test_a_model_file_that_is_no_utf8_is_not_what_the_tables_say(tmp_path, name):
    folder = robot_folder(tmp_path)
    (folder / name).write_bytes((folder / name).read_bytes() + b"\xfa")
    with pytest.raises(RobotError, match=rf"{name}: the file is not what the tables"):
        load_robot(folder)


@pytest.mark.parametrize("number", [each for each in STRANGE_NUMBERS if each != "010"])
def test_a_cell_that_is_no_plain_decimal_is_refused(tmp_path, measured, number):
    folder = robot_folder(tmp_path)
    for name, column in (("standing.csv", 1), ("joints.csv", 6)):
        lines = (folder / name).read_text().splitlines()
        cells = lines[3].split(",")
        cells[column] = number
        (folder / name).write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:]]) + "\n")
    with pytest.raises(FileError, match=r"standing\.csv: .* is no finite decimal number"):
        read_standing_pose(folder, load_robot("t1"))
    with pytest.raises(RobotError, match=r"joints\.csv, line 4: .* is '"):
        load_robot(folder)
    motors = (measured / "motors.csv").read_text().splitlines()
    place = next(index for index, line in enumerate(motors) if not line.startswith(("#", "motor,")))
    cells = motors[place].split(",")
    cells[4] = number
    (measured / "motors.csv").write_text("\n".join([*motors[:place], ",".join(cells)]) + "\n")
    with pytest.raises(FileError, match=rf"motors\.csv, line {place + 1}: .* is no finite decimal number"):
        read_motors(measured / "motors.csv", ACTUATORS.model)


def test_a_standing_pose_that_is_no_utf8_is_named_with_its_line(tmp_path):
    folder = robot_folder(tmp_path)
    (folder / "standing.csv").write_bytes((folder / "standing.csv").read_bytes() + b"\xe9\n")
    with pytest.raises(FileError, match=r"standing\.csv, line \d+: the byte 0xe9 is no UTF-8 text"):
        read_standing_pose(folder, load_robot("t1"))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda lines: [*lines, f"{LONG},1"],
        lambda lines: [*lines[:-1], lines[-1] + ",1"],
        lambda lines: [*lines[:-1], lines[-1].rpartition(",")[0] + ",1_0"],
        lambda lines: [*lines, "\udce9"],
        lambda lines: [],
    ],
    ids=["long field", "one more", "1_0", "no UTF-8", "empty"],
)
def test_a_faulty_table_of_actuators_is_refused(tmp_path, spoil):
    robot = load_robot("t1")
    values = settings.read(ROOT / "data/actuators.yaml", ActuatorSettings)
    write_adapted_robot(tmp_path, ROOT / "robots/t1", adapt(robot, [], values))
    assert [each.joint for each in read_actuators(tmp_path)] == list(robot.joint_names)
    path = tmp_path / "actuators.csv"
    lines = spoil(path.read_text().splitlines())
    path.write_bytes("\n".join(lines).encode(errors="surrogateescape"))
    with pytest.raises(FileError, match=r"actuators\.csv"):
        read_actuators(tmp_path)


@pytest.mark.parametrize("number", STRANGE_NUMBERS)
@pytest.mark.parametrize("quoted", [False, True], ids=["plain", "quoted"])
def test_a_number_that_is_no_plain_decimal_is_refused(tmp_path, number, quoted):
    text = (ROOT / "data/curation.yaml").read_text()
    path = tmp_path / "curation.yaml"
    path.write_text(
        text.replace("shortest_s: 0.5 ", f"shortest_s: '{number}' " if quoted else f"shortest_s: {number} ")
    )
    with pytest.raises(SettingsError, match="'shortest_s' is "):
        settings.read(path, Curation)


@pytest.mark.parametrize(("number", "value"), [("0.5", 0.5), ("1", 1.0), (".5", 0.5), ("5e-1", 0.5), ("+1.0", 1.0)])
def test_plain_decimals_are_numbers(tmp_path, number, value):
    path = tmp_path / "curation.yaml"
    path.write_text((ROOT / "data/curation.yaml").read_text().replace("shortest_s: 0.5 ", f"shortest_s: {number} "))
    assert settings.read(path, Curation).shortest_s == value


def test_a_manifest_that_is_null_is_a_sentence(tmp_path):
    store = Store(root=tmp_path)
    store.manifest_path("motion_catalog").parent.mkdir()
    for text in ("null", "[]", "3", json.dumps({"schema": None})):
        store.manifest_path("motion_catalog").write_text(text)
        with pytest.raises(FileError, match=r"motion_catalog\.json: not a readable manifest"):
            store.load("motion_catalog")
