"""Motion files with a planted fault are understood, flagged or refused in a sentence, by the stages and the command."""

import contextlib
import io
import json
import re
from collections import Counter

import pytest

from pipeline.cli.main import main
from tests.factories import mutants_bvh, mutants_npz, mutants_text
from tests.factories.fates import catalogued, fate, new_findings
from tests.factories.mutant import REFUSED, Mutant, understood

LEAST_MUTANTS = 200

CORPUS: dict[str, tuple[Mutant, list[Mutant]]] = {
    "bvh": (understood("walk.bvh", {"clean": mutants_bvh.CLEAN})[0], mutants_bvh.bvh_mutants()),
    "amc": (
        understood("07_01.amc", {"clean": mutants_text.AMC}, beside=mutants_text.BESIDE)[0],
        mutants_text.amc_mutants(),
    ),
    "deepmimic": (
        understood("walk.txt", {"clean": json.dumps(mutants_text.MOTION)})[0],
        mutants_text.deepmimic_mutants(),
    ),
    "csv": (understood("robot.csv", {"clean": mutants_text.robot_csv()})[0], mutants_text.csv_mutants()),
    "npz": (
        understood("walk.npz", {"clean": mutants_npz.packed(mutants_npz.arrays())})[0],
        mutants_npz.npz_mutants(),
    ),
}
"""Format -> its clean file and all faults of it."""


def faults_of(mutant, got, sentence, path) -> list[str]:
    """Differences between the outcome of a mutant and the wanted one."""
    faults = []
    if got != mutant.want:
        faults.append(f"{mutant.name}: {got}, expected {mutant.want} ({sentence[:160]})")
    elif mutant.want == REFUSED:
        if not re.search(mutant.says, sentence):
            faults.append(f"{mutant.name}: the sentence does not match '{mutant.says}': {sentence[:300]}")
        if path.parent.name not in sentence or not 10 < len(sentence) < 1_500 or "\n" in sentence:
            faults.append(f"{mutant.name}: no sentence that names the file: {sentence[:300]}")
    return faults


@pytest.mark.parametrize("kind", CORPUS)
def test_the_stage_understands_flags_or_refuses_each_file(tmp_path, kind):
    clean_mutant, mutants = CORPUS[kind]
    clean = catalogued(clean_mutant.put(tmp_path / "clean")).pieces[0]
    faults = []
    for index, mutant in enumerate(mutants):
        path = mutant.put(tmp_path / f"mutant{index}")
        faults += faults_of(mutant, *fate(path, clean), path)
    assert not faults, "\n".join(["", *faults])


@pytest.mark.parametrize("kind", CORPUS)
def test_the_clean_file_has_no_new_findings(tmp_path, kind):
    clean = catalogued(CORPUS[kind][0].put(tmp_path / "clean")).pieces[0]
    assert new_findings(clean, clean) == []


@pytest.mark.parametrize("kind", CORPUS)
def test_the_command_prints_one_sentence_or_the_clip_and_no_traceback(tmp_path, kind):
    faults = []
    for index, mutant in enumerate(CORPUS[kind][1]):
        path = mutant.put(tmp_path / f"mutant{index}")
        out, errors = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
            code = main(["inspect", str(path), "--json"])
        lines = errors.getvalue().splitlines()
        refused = (
            code == 1 and len(lines) == 1 and lines[0].startswith("booster-lab: ") and path.parent.name in lines[0]
        )
        if not (code == 0 and out.getvalue().startswith("{") if mutant.want != REFUSED else refused):
            faults.append(f"{mutant.name}: exit {code}, {errors.getvalue()[:300]}")
    assert not faults, "\n".join(["", *faults])


def test_the_corpus_is_large_and_each_fault_is_another():
    every = [mutant for _, mutants in CORPUS.values() for mutant in mutants]
    assert len(every) >= LEAST_MUTANTS
    assert Counter(mutant.name for mutant in every).most_common(1)[0][1] == 1
    contents = Counter((mutant.file, mutant.content, str(mutant.beside)) for mutant in every)
    assert contents.most_common(1)[0][1] == 1, [key[0] for key, count in contents.items() if count > 1]
