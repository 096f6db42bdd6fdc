"""Checks every command's document against its schema in `docs/schemas/` (JSON Schema, draft 2020-12), and every figure's PDF against its PNG.

usage: documents_and_schemas.py [--quick]; quick leaves out the commands that need finite elements.
"""

import json
import pathlib
import sys
import tempfile

import jsonschema
import matplotlib.image
import numpy
import pypdfium2

import small_experiment

# Largest fraction of pixels in which PDF and PNG may differ: thin edges.
MOST_UNLIKE = 0.005
SCHEMAS = small_experiment.ROOT / "docs" / "schemas"
# On an instrument, in this order: later commands continue from earlier ones.
OF_STUDY = [
    ("init", ["init", "eye/trajectory.csv", "--out", "described"]),
    ("check", ["check", "eye"]),
    ("posterior", ["sample", "eye", "--out", "study"]),
    ("fit", ["fit", "study"]),
    ("effects", ["effects", "study"]),
    ("comparison", ["compare", "study"]),
    ("laws", ["compare", "study", "--laws", "lethersich,maxwell"]),
    ("diagnosis", ["diagnose", "study"]),
    ("learned", ["learn", "study"]),
    ("extension", ["extend", "study", "--with", "clock-offset"]),
    ("ladder", ["ladder", "study"]),
    ("groups", ["groups", "cohort", "--out", "compared"]),
    ("tasks", ["tasks", "sample", "cohort", "--out", "listed"]),
    ("gathered", ["gather", "listed"]),
    ("tasks", ["tasks", "calibration", "eye", "--count", "20", "--out", "calibrated"]),
    ("gathered", ["gather", "calibrated"]),
    ("learned-cohort", ["learn", "cohort", "--out", "learnt"]),
    ("cohort-diagnosis", ["diagnose", "cohort", "--out", "together", "--simulations", "19"]),
    ("check", ["check", "sweep"]),
    ("oscillation", ["sample", "sweep", "--out", "swept"]),
    ("oscillation-diagnosis", ["diagnose", "swept"]),
    ("joint", ["sample", "eye", "sweep", "--out", "both"]),
    ("posterior", ["sample", "eye", "--out", "law", "--base", "law.toml", "--noise", "white,ou,gain,student"]),
    ("groups", ["groups", "cohort", "--out", "network", "--base", "law.toml"]),
]
OF_FINITE_ELEMENTS = [
    ("posterior", ["sample", "--out", "replica"]),
    ("fit", ["fit", "replica"]),
    ("effects", ["effects", "replica"]),
    ("simulation", ["simulate", "--out", "simulated"]),
    ("shapes", ["shapes", "--out", "replica"]),
    ("prediction", ["predict", "replica"]),
    ("design", ["design", "replica"]),
    ("plan", ["plan", "replica", "--reach-mm", "0.3", "--within-s", "3"]),
    ("challenge", ["challenge", "run", "--count", "2"]),
]


def problems(kind, document):
    """Violations of the schema, in words."""
    schema = json.loads((SCHEMAS / f"{kind}-1.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    errors = jsonschema.Draft202012Validator(schema).iter_errors(document)
    return [f"{kind}: {error.json_path}: {error.message[:200]}" for error in errors]


def unlike_pdfs(folder):
    """Figures whose PDF, drawn by PDFium, differs from their PNG. Both renderers smooth edges differently, so only pixels that differ by half count; `count` is the number of figures."""
    found, count = [], 0
    for path in pathlib.Path(folder).rglob("*.pdf"):
        document = pypdfium2.PdfDocument(path)
        # The PNG has 1.5 pixels per SVG unit, the PDF 0.75 points.
        drawn = document[0].render(scale=2.0).to_numpy()[:, :, ::-1].astype(float) / 255.0
        expected = matplotlib.image.imread(path.with_suffix(".png"))[:, :, :3]
        height, width = (min(sizes) for sizes in zip(drawn.shape[:2], expected.shape[:2]))
        unlike = numpy.abs(drawn[:height, :width] - expected[:height, :width]).max(axis=2) > 0.5
        if len(document) != 1 or unlike.mean() > MOST_UNLIKE or abs(drawn.shape[0] - expected.shape[0]) > 2:
            found.append(f"{path.name}: {len(document)} pages, {100 * unlike.mean():.2f} % of the pixels differ from the PNG")
        count += 1
    return found, count


def main():
    commands = OF_STUDY if "--quick" in sys.argv else OF_STUDY + OF_FINITE_ELEMENTS
    found, seen = [], set()
    with tempfile.TemporaryDirectory() as folder:
        small_experiment.write(folder, "eye")
        small_experiment.write_sweep(folder, "sweep")
        (pathlib.Path(folder) / "law.toml").write_text('[base.network]\nparallel = [{ spring = "gel" }, { springpot = "mesh" }]\n')
        for index, (species, factor) in enumerate([("porcine", 1.0), ("porcine", 1.2), ("bovine", 2.0), ("bovine", 2.3)]):
            small_experiment.write(f"{folder}/cohort", f"{species}-{index}", species, factor, seed=index, cycles=2)
        for kind, arguments in commands:
            if arguments == ["gather", "calibrated"]:
                small_experiment.run(folder, "tasks", "run", "calibrated", "--quiet")
            document = json.loads(small_experiment.run(folder, *arguments, "--json", "-", "--quiet"))
            found += problems(kind, document)
            seen.add(kind)
            # A schema that allows anything would prove nothing.
            for key in ("schema", "version"):
                assert problems(kind, {name: value for name, value in document.items() if name != key}), f"{kind} without {key} is allowed"
            assert problems(kind, {**document, "schema": "vitreo-uq/other/1"}), f"{kind}: another schema is allowed"
        for written in pathlib.Path(folder).rglob("*.json"):
            document = json.loads(written.read_text())
            kind = document.get("schema", "").split("/")[1]
            if (SCHEMAS / f"{kind}-1.json").exists():
                seen.add(kind)
                found += [f"{written.name}: {text}" for text in problems(kind, document)]
        unlike, n_figures = unlike_pdfs(folder)
        found += unlike
    assert "calibration" in seen, "no calibration was gathered"
    assert n_figures > 20, f"only {n_figures} figures"
    if found:
        print("\n".join(found))
        sys.exit(1)
    print(f"documents of {len(seen)} kinds match their schemas, and {n_figures} figures their PDF")


if __name__ == "__main__":
    main()
