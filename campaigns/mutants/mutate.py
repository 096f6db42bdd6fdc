#!/usr/bin/env python3
"""Draws small faults in the library's code, puts each into a copy of the commit, and notes which test finds it."""

import argparse
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BESIDE = {"python", "source-hash"}
# A stage of tests that takes longer, compiling left out, has found the mutant.
MOST_SECONDS = 1800
# Characters of a masked text that were no code. Same length as the text, so that places agree.
HIDDEN = re.compile(r'//[^\n]*|/\*.*?\*/|b?r(#*)".*?"\1|b?"(?:\\.|[^"\\])*"|b?\'(?:\\[^\n]*?|[^\'\\\n])\'', re.S)


def blank(text, start, end):
    """The text with a part of it blanked, line breaks kept."""
    return text[:start] + re.sub(r"[^\n]", " ", text[start:end]) + text[end:]


def closing(text, start, brackets):
    """Place behind the bracket that closes the one at `start`."""
    depth = 0
    for place in range(start, len(text)):
        depth += (text[place] == brackets[0]) - (text[place] == brackets[1])
        if depth == 0:
            return place + 1
    return len(text)


def masked(text):
    """A source text with strings, characters, comments, attributes and test code blanked."""
    text = HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    while found := re.search(r"#!?\[", text):
        end = closing(text, found.end() - 1, "[]")
        is_for_tests = text[found.start() : end] == "#[cfg(test)]"
        text = blank(text, found.start(), end)
        if is_for_tests:
            while more := re.compile(r"\s*#\[").match(text, end):
                end = closing(text, more.end() - 1, "[]")
            semicolon, brace = (text.find(sign, end) % (len(text) + 1) for sign in ";{")
            text = blank(text, found.start(), semicolon + 1 if semicolon < brace else closing(text, brace, "{}"))
    return text


def is_test_file(path):
    return path.stem == "tests" or path.stem.endswith("_tests") or path.stem.startswith("test_")


def larger(literal):
    """A number that is larger by one, or by a tenth where it is no integer; its type stays."""
    number, kind = re.fullmatch(r"([\d_.]+(?:[eE][+-]?\d+)?)(_?[fiu]\w+)?", literal).groups(default="")
    plain = number.replace("_", "")
    if re.fullmatch(r"\d+", plain) and "f" not in kind:
        return f"{int(plain) + 1}{kind}"
    return f"{float(f'{1.1 * float(plain):.12g}') or 1.0!r}{kind}"


def negated(text, start):
    """Replacement of the condition behind an `if` that ends at `start`; None for patterns and conditions of several lines."""
    depth = 0
    for place in range(start, len(text)):
        depth += (text[place] in "([") - (text[place] in ")]")
        if text[place] == "\n":
            return None
        if depth == 0 and text.startswith((" {", " =>"), place):
            condition = text[start:place]
            return None if re.search(r"\blet\b", condition) else (start, place, f"!({condition})")
    return None


def mutations(text, code, start, end):
    """Mutations of a line by their kinds: start, end and what stands there instead. `code` is the masked text."""
    found = {}

    def swap(kind, pattern, instead):
        for match in re.compile(pattern).finditer(code, start, end):
            for new in instead(match[1]):
                found.setdefault(kind, []).append((match.start(1), match.end(1), new))

    swap("comparison", r"(?<=\s)(<=|>=|<|>)(?=\s)", lambda old: [new for new in ("<", "<=", ">", ">=") if new != old])
    swap("sum", r"(?<=\s)([+-])=?(?=\s)", lambda old: ["-" if old == "+" else "+"])
    swap("product", r"(?<=\s)([*/])=?(?=\s)", lambda old: ["/" if old == "*" else "*"])
    swap("logic", r"(?<=\s)(&&|\|\|)(?=\s)", lambda old: ["||" if old == "&&" else "&&"])
    swap("number", r"(?<![\w.])(\d[\d_]*(?:\.\d[\d_]*)?(?:[eE][+-]?\d+)?(?:_?(?:f64|f32|[iu](?:8|16|32|64|size)))?)(?!\w)", lambda old: [larger(old)])
    swap("not", r"(?<![\w!])(!)(?=[\w(])", lambda old: [""])
    swap("extreme", r"(?<=[.:])(min|max)(?=\()", lambda old: ["max" if old == "min" else "min"])
    for match in re.compile(r"\bif (?=\S)").finditer(code, start, end):
        # The condition as it is written, strings included, and its end by the masked text.
        if whole := negated(code, match.end()):
            found.setdefault("condition", []).append((whole[0], whole[1], f"!({text[whole[0] : whole[1]]})"))
    line = code[start:end].strip()
    place = start + code[start:end].find(line)
    if match := re.fullmatch(r"(?:return )?(true|false);?", line):
        at = place + line.index(match[1])
        found["boolean"] = [(at, at + len(match[1]), "false" if match[1] == "true" else "true")]
    elif re.search(r"-> bool \{\s*$", code[:start]) and re.match(r"\s*\}", code[end:]) and "?" not in line and line:
        found["boolean"] = [(place, place + len(line), new) for new in ("true", "false")]
    return found


def library():
    """Internal dependencies of each library crate, by the names of folders."""
    crates = sorted(path.name for path in (ROOT / "crates").iterdir() if path.name not in BESIDE)
    manifests = {name: (ROOT / "crates" / name / "Cargo.toml").read_text(encoding="utf-8") for name in crates}
    section = {name: text.split("[dependencies]", 1)[1].split("\n[", 1)[0] for name, text in manifests.items()}
    return {name: {used for used in crates if re.search(rf"^{used}\b", section[name], re.M)} for name in crates}


def above(crates, name):
    """Crates that use a crate, directly or not."""
    using = {other for other, used in crates.items() if name in used}
    return sorted(using.union(*(above(crates, other) for other in using)))


def draws(crates, seed):
    """Mutants without end: a line of code, then a kind of mutation, then one of it. Never the same twice."""
    texts, lines = {}, []
    for name in sorted(crates):
        for path in sorted((ROOT / "crates" / name / "src").rglob("*.rs")):
            if is_test_file(path):
                continue
            text = path.read_text(encoding="utf-8")
            code = masked(text)
            texts[path] = text, code
            start = 0
            for number, line in enumerate(code.split("\n"), 1):
                if line.strip():
                    lines.append((name, path, number, start, start + len(line)))
                start += len(line) + 1
    stream, drawn = random.Random(seed), set()
    while True:
        name, path, number, start, end = stream.choice(lines)
        text, code = texts[path]
        kinds = mutations(text, code, start, end)
        if not kinds:
            continue
        kind = stream.choice(sorted(kinds))
        first, last, new = stream.choice(kinds[kind])
        if (path, first, new) in drawn:
            continue
        drawn.add((path, first, new))
        end = max(end, last)
        yield {
            "crate": name,
            "file": str(path.relative_to(ROOT)),
            "line": number,
            "kind": kind,
            "before": text[start:end].strip(),
            "after": (text[start:first] + new + text[last:end]).strip(),
        }, text[:first] + new + text[last:]


class Copy:
    """The commit in a directory of its own, where tests run."""

    def __init__(self, out):
        self.tree, self.log, self.cache = out / "tree", out / "last.log", out / "cache"
        shutil.rmtree(self.tree, ignore_errors=True)
        self.tree.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, stdout=subprocess.PIPE)
        subprocess.run(["tar", "x"], cwd=self.tree, input=archive.stdout, check=True)
        self.environment = {**os.environ, "CARGO_TARGET_DIR": str(out / "target"), "VITREO_UQ_CACHE": str(self.cache)}

    def cargo(self, *arguments, seconds=None):
        """Exit code of a cargo command, None after `seconds`; and what it said."""
        with self.log.open("w", encoding="utf-8") as log:
            command = ["cargo", *arguments]
            process = subprocess.Popen(command, cwd=self.tree, env=self.environment, stdout=log, stderr=log, start_new_session=True)
            try:
                code = process.wait(seconds)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                code = None
        return code, self.log.read_text(encoding="utf-8", errors="replace")

    def killer(self, arguments):
        """The test that fails; None where all pass. Raises where the tests do not compile."""
        code, said = self.cargo("test", "--locked", "--no-run", *arguments)
        if code != 0:
            raise NotCompiled(said[-2000:])
        code, said = self.cargo("test", "--locked", *arguments, seconds=MOST_SECONDS)
        if code == 0:
            return None
        binary = re.findall(r"^ +(?:Running|Doc-tests) (.*?)(?: \(.*\))?$", said, re.M)[-1:]
        failed = re.findall(r"^test (.*?) \.\.\. FAILED$", said, re.M)[:1]
        what = failed[0] if failed else "no end in time" if code is None else "the test program was stopped"
        return ": ".join([*binary, what])

    def outcome(self, crates, name, n_stages):
        """Runs the first stages until a test fails."""
        shutil.rmtree(self.cache, ignore_errors=True)
        packages = [f"--package=vitreo-uq-{other}" for other in above(crates, name)]
        stages = [
            ("own unit tests", [f"--package=vitreo-uq-{name}", "--lib"]),
            ("unit tests above", [*packages, "--lib"] if packages else None),
            ("all tests", []),
        ]
        for stage, arguments in stages[:n_stages]:
            if arguments is not None and (by := self.killer(arguments)):
                return {"outcome": "killed", "stage": stage, "by": by}
        return {"outcome": "survived"}


class NotCompiled(Exception):
    """Tests that a mutant keeps from compiling."""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target/campaigns/mutants")
    parser.add_argument("--list", action="store_true", help="show the draws and run nothing")
    parser.add_argument("--stages", type=int, default=3, help="how many stages are run: 1 leaves out the tests of other crates and the integration tests, which take hours")
    parser.add_argument("--passed", action="store_true", help="the tests of this commit passed elsewhere: do not run them first")
    arguments = parser.parse_args()
    crates = library()
    drawn = draws(crates, arguments.seed)
    if arguments.list:
        for _ in range(arguments.count):
            mutant, _ = next(drawn)
            print(f"{mutant['file']}:{mutant['line']} ({mutant['kind']})\n  - {mutant['before']}\n  + {mutant['after']}")
        return

    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()
    if subprocess.run(["git", "diff", "--quiet", "HEAD", "--", "crates"], cwd=ROOT, check=False).returncode:
        sys.exit("crates/ differs from the commit, and mutants are drawn in a commit: commit or stash the changes first")
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "mutants.json"
    noted = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"commit": head, "seed": arguments.seed, "mutants": []}
    if (noted["commit"], noted["seed"]) != (head, arguments.seed):
        sys.exit(f"{path} is of commit {noted['commit']} and seed {noted['seed']}: begin anew without RESUME")
    mutants = noted["mutants"]
    copy = Copy(arguments.out)
    if not (mutants or arguments.passed) and (by := copy.killer([])):
        sys.exit(f"a test fails without any mutant: {by}")
    # The draws come in the same order again; those with an outcome are passed over.
    for _ in mutants:
        next(drawn)
    while sum(mutant["outcome"] != "not compiled" for mutant in mutants) < arguments.count:
        mutant, text = next(drawn)
        place = copy.tree / mutant["file"]
        sound = place.read_text(encoding="utf-8")
        place.write_text(text, encoding="utf-8")
        started = time.monotonic()
        try:
            code, _ = copy.cargo("check", "--locked", f"--package=vitreo-uq-{mutant['crate']}")
            mutant.update(copy.outcome(crates, mutant["crate"], arguments.stages) if code == 0 else {"outcome": "not compiled"})
        except NotCompiled:
            mutant["outcome"] = "not compiled"
        mutant["seconds"] = round(time.monotonic() - started)
        place.write_text(sound, encoding="utf-8")
        mutants.append(mutant)
        fresh = path.with_suffix(".new")
        fresh.write_text(json.dumps(noted, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        fresh.replace(path)
        print(f"{mutant['file']}:{mutant['line']} {mutant['outcome']} {mutant.get('by', '')}", flush=True)


if __name__ == "__main__":
    main()
