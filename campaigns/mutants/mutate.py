#!/usr/bin/env python3
"""Draws small faults in the library's code, puts all of them into a copy of the commit, where an environment variable chooses one, and notes which test finds it."""

import argparse
import contextlib
import dataclasses
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BESIDE = {"python", "source-hash"}
# Chooses the mutant while the tests run.
CHOICE = "VITREO_UQ_MUTANT"
# A test program that takes this many times as long as without a mutant, and a minute more, has found it.
SLOWER = 10
# All mutants go through the tests of their own crates first, which take seconds.
STAGES = "own tests", "other tests"
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
        }, (first, last, new)


def bodies(code):
    """Places of the bodies of functions, braces included; constant functions are left out, because they cannot choose."""
    for match in re.finditer(r"(\bconst\s+)?\bfn\s+\w+", code):
        depth = 0
        for place in range(match.end(), len(code)):
            depth += (code[place] in "([") - (code[place] in ")]")
            if depth == 0 and code[place] in ";{":
                if code[place] == "{" and not match[1]:
                    yield place, closing(code, place, "{}")
                break


def with_choices(text, changes):
    """A source text in which every function with mutants asks which one it has; `changes` are numbers and places. None where a mutant stands outside functions."""
    inside = {}
    code = masked(text)
    for number, (first, last, new) in changes:
        around = [body for body in bodies(code) if body[0] < first and last < body[1]]
        if not around:
            return None
        start, end = max(around)
        inside.setdefault((start, end), []).append((number, text[start:first] + new + text[last:end]))
    for (start, end), mutated in sorted(inside.items(), reverse=True):
        branches = "".join(f"if crate::has_mutant({number}) {body} else " for number, body in mutated)
        text = f"{text[:start]}{{ {branches}{text[start:end]} }}{text[end:]}"
    return text


# A build refuses an index that is always out of range, a check does not: such a mutant compiles, and panics.
ALLOWS = "#![allow(unconditional_panic, arithmetic_overflow)]\n"
CHOOSES = f"""
pub(crate) fn has_mutant(number: u32) -> bool {{
    static CHOSEN: std::sync::OnceLock<Option<u32>> = std::sync::OnceLock::new();
    *CHOSEN.get_or_init(|| std::env::var("{CHOICE}").ok()?.parse().ok()) == Some(number)
}}
"""


class Copy:
    """The commit in a directory of its own, where tests run."""

    def __init__(self, out):
        self.tree, self.log, self.cache = out / "tree", out / "last.log", out / "cache"
        shutil.rmtree(self.tree, ignore_errors=True)
        self.tree.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, stdout=subprocess.PIPE)
        subprocess.run(["tar", "x"], cwd=self.tree, input=archive.stdout, check=True)
        self.environment = {**os.environ, "CARGO_TARGET_DIR": str(out / "target"), "VITREO_UQ_CACHE": str(self.cache)}

    @contextlib.contextmanager
    def changed(self, mutants, keeps_times=False):
        """Has mutants in the sources for a while: at choice, or the only one where it stands outside functions. `mutants` are numbers, descriptions and places.
        If the sources keep their times, what is built here stays valid, also for the tests that call cargo: without a choice it is sound."""
        texts = {}
        for file in {description["file"] for _, description, _ in mutants}:
            changes = [(number, place) for number, description, place in mutants if description["file"] == file]
            texts[self.tree / file] = with_choices(read(self.tree / file), changes) or alone(read(self.tree / file), changes)
        for name in {description["crate"] for _, description, _ in mutants}:
            root = self.tree / "crates" / name / "src/lib.rs"
            texts[root] = ALLOWS + texts.get(root, read(root)) + CHOOSES
        sound = {path: (read(path), path.stat()) for path in texts}
        try:
            for path, text in texts.items():
                path.write_text(text, encoding="utf-8")
            yield
        finally:
            for path, (text, before) in sound.items():
                path.write_text(text, encoding="utf-8")
                if keeps_times:
                    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))

    def compiles(self, mutant):
        with self.changed([mutant]), self.log.open("w", encoding="utf-8") as log:
            command = ["cargo", "check", "--locked", f"--package=vitreo-uq-{mutant[1]['crate']}"]
            return subprocess.run(command, cwd=self.tree, env=self.environment, stdout=log, stderr=log, check=False).returncode == 0

    def programs(self):
        """Test programs of the sources as they are: package, name and path of each."""
        command = ["cargo", "test", "--locked", "--no-run", "--message-format=json"]
        with self.log.open("w", encoding="utf-8") as log:
            built = subprocess.run(command, cwd=self.tree, env=self.environment, stdout=subprocess.PIPE, stderr=log, check=True, text=True)
        messages = [json.loads(line) for line in built.stdout.splitlines()]
        tests = [message for message in messages if message.get("executable") and message["profile"]["test"]]
        return [Program(pathlib.Path(test["manifest_path"]).parent, test["target"]["name"], test["executable"]) for test in tests]

    def killer(self, program, number, most_seconds):
        """The test of a program that fails; None where all pass."""
        environment = {**self.environment, "CARGO_MANIFEST_DIR": str(program.package), **({CHOICE: str(number)} if number else {})}
        process = subprocess.Popen(
            [program.path], cwd=program.package, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace", start_new_session=True
        )
        stop = threading.Timer(most_seconds, os.killpg, [process.pid, signal.SIGKILL]) if most_seconds else None
        if stop:
            stop.start()
        try:
            for line in process.stdout:
                if failed := re.match(r"test (.*?) \.\.\. FAILED", line):
                    return failed[1]
            if process.wait() == 0:
                return None
            return "no end in time" if stop and stop.finished.is_set() else "the test program was stopped"
        finally:
            if stop:
                stop.cancel()
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def outcome(self, crates, number, mutant, stage, programs):
        """Runs the tests of a stage, the fast programs first, until one fails: those of the faulty crate, or those above it."""
        shutil.rmtree(self.cache, ignore_errors=True)
        own = self.tree / "crates" / mutant["crate"]
        tested = {own} if stage == STAGES[0] else {self.tree, *(self.tree / "crates" / name for name in above(crates, mutant["crate"]))}
        for program in sorted((program for program in programs if program.package in tested), key=lambda program: program.seconds):
            if by := self.killer(program, number, 60 + SLOWER * program.seconds):
                return {"outcome": "killed", "stage": stage, "by": f"{program.package.name} {program.name}: {by}"}
        return {"passed": stage} if stage == STAGES[0] else {"outcome": "survived"}


@dataclasses.dataclass
class Program:
    package: pathlib.Path
    name: str
    path: str
    # Without a mutant.
    seconds: float = 0.0


def read(path):
    return path.read_text(encoding="utf-8")


def alone(text, changes):
    """A source text with its one mutant."""
    ((_, (first, last, new)),) = changes
    return text[:first] + new + text[last:]


def stop(why):
    """Ends the campaign; exit code 1 would be a result."""
    print(why, file=sys.stderr)
    sys.exit(2)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target/campaigns/mutants")
    parser.add_argument("--list", action="store_true", help="show the draws and run nothing")
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
        stop("crates/ differs from the commit, and mutants are drawn in a commit: commit or stash the changes first")
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "mutants.json"
    noted = json.loads(read(path)) if path.exists() else {"commit": head, "seed": arguments.seed, "mutants": []}
    if (noted["commit"], noted["seed"]) != (head, arguments.seed):
        stop(f"{path} is of commit {noted['commit']} and seed {noted['seed']}: begin anew without RESUME")

    def note():
        fresh = path.with_suffix(".new")
        fresh.write_text(json.dumps(noted, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        fresh.replace(path)

    copy = Copy(arguments.out)
    mutants = noted["mutants"]
    # The draws come in the same order again.
    places = [next(drawn)[1] for _ in mutants]
    while sum(mutant["compiles"] for mutant in mutants) < arguments.count:
        mutant, place = next(drawn)
        mutant["compiles"] = copy.compiles((len(mutants) + 1, mutant, place))
        mutants.append(mutant)
        places.append(place)
        note()

    numbered = [(number, mutant, place) for number, (mutant, place) in enumerate(zip(mutants, places, strict=True), 1) if mutant["compiles"]]
    at_choice = [one for one in numbered if with_choices(read(copy.tree / one[1]["file"]), [(one[0], one[2])])]

    def play(number, mutant, choice, stage, programs):
        if "outcome" in mutant or mutant.get("passed") == stage:
            return
        started = time.monotonic()
        mutant.update(copy.outcome(crates, choice, mutant, stage, programs))
        mutant["seconds"] = mutant.get("seconds", 0) + round(time.monotonic() - started)
        note()
        print(f"{number} {mutant['file']}:{mutant['line']} {mutant.get('outcome', 'passed its own tests')} {mutant.get('by', '')}", flush=True)

    with copy.changed(at_choice, keeps_times=True):
        programs = copy.programs()
    for program in programs:
        started = time.monotonic()
        if by := copy.killer(program, None, None):
            stop(f"a test of {program.name} fails without any mutant: {by}")
        program.seconds = time.monotonic() - started
    for stage in STAGES:
        for number, mutant, _ in at_choice:
            play(number, mutant, number, stage, programs)
    seconds = {(program.package, program.name): program.seconds for program in programs}
    for one in numbered:
        if "outcome" not in one[1]:
            with copy.changed([one]):
                programs = copy.programs()
            for program in programs:
                program.seconds = seconds[program.package, program.name]
            for stage in STAGES:
                play(one[0], one[1], None, stage, programs)


if __name__ == "__main__":
    main()
