"""Functions that run the program in the wheel.

Commands take minutes and run in a child process. Progress, Ctrl-C, checkpoints and exit codes are therefore those of the program.
A crash or a full memory ends only the child.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vitreo_uq._native import Experiment
from vitreo_uq.errors import Error, InputError, NotTrusted

Target = Experiment | str | os.PathLike[str]
"""An experiment or a study. An `Experiment` is passed as its path, the replica as no path."""


def program() -> str:
    """Path of the program: the one of this installation, else the one on the PATH."""
    name = "vitreo-uq.exe" if os.name == "nt" else "vitreo-uq"
    for scheme in (None, f"{os.name}_user"):
        folder = sysconfig.get_path("scripts") if scheme is None else sysconfig.get_path("scripts", scheme)
        if folder and (Path(folder) / name).is_file():
            return str(Path(folder) / name)
    found = shutil.which(name)
    if found is None:
        raise Error("the program vitreo-uq is neither beside Python nor on the PATH\n  what to do: install the wheel again")
    return found


def run(*arguments: str | os.PathLike[str], progress: bool = False) -> dict[str, Any]:
    """Runs a command of the program and returns its JSON document.

    `arguments` are the command's words without ``--json``; `progress` shows its messages on standard error. Raises `InputError` if the program
    refuses its input and `Error` if it fails. Warns with `NotTrusted` if the result cannot be trusted.
    """
    words = [os.fspath(word) for word in arguments]
    command = [program(), *words, "--json", "-", *([] if progress else ["--quiet"])]
    said: list[str] = []
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8") as child:
        assert child.stdout is not None and child.stderr is not None

        def listen() -> None:
            for line in child.stderr or ():
                said.append(line)
                if progress:
                    # A notebook shows output of Python's stream, not of the child's own.
                    print(line, end="", file=sys.stderr)

        listener = threading.Thread(target=listen, daemon=True)
        listener.start()
        try:
            text = child.stdout.read()
            code = child.wait()
        except KeyboardInterrupt:
            # A notebook interrupts only Python. The program stops within a second and leaves nothing half-written.
            child.send_signal(signal.SIGINT)
            try:
                child.wait(timeout=10)
            except subprocess.TimeoutExpired:
                child.kill()
            raise
        listener.join()
    message = _message(said) or f"{words[0] if words else 'the program'} ended with exit code {code}"
    if code == 2:
        raise InputError(message)
    if code not in (0, 1):
        raise Error(message)
    try:
        document: dict[str, Any] = json.loads(text)
    except json.JSONDecodeError:
        raise Error(message) from None
    if code == 1:
        reasons = "; ".join(str(own.get("text")) for own in document.get("warnings", []) if isinstance(own, dict))
        warnings.warn(f"{words[0]}: not to be trusted as it stands: {reasons or message}", NotTrusted, stacklevel=3)
    return document


def _message(said: Sequence[str]) -> str:
    """Error message of the program: from its line `error: …` on, otherwise its whole output."""
    starts = [place for place, line in enumerate(said) if line.startswith("error: ")]
    return "".join(said[starts[-1] :] if starts else said).removeprefix("error: ").strip()


def _words(target: Target | None) -> list[str]:
    path = target.path if isinstance(target, Experiment) else target
    return [] if path is None else [os.fspath(path)]


def _options(**options: object) -> list[str]:
    """Options of the program: lists are joined by commas, mappings give one option per name, None and empty values are left out."""
    words: list[str] = []
    for name, value in options.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(option)
        elif isinstance(value, Mapping):
            for key, number in value.items():
                words += [option, f"{key}={'free' if number is None else repr(float(number))}"]
        elif isinstance(value, (list, tuple)):
            words += [option, ",".join(map(str, value))] if value else []
        else:
            words += [option, str(value)]
    return words


def _listed(argument: str, names: Sequence[str]) -> list[str]:
    """A list of names; a single text would be taken for a list of letters."""
    if isinstance(names, str):
        raise InputError(f"`{argument}`: {names!r} is a single text\n  what to do: give a list, as in [{names!r}]")
    return list(names)


def sample(
    target: Target | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    base: str | None = None,
    effects: Sequence[str] = (),
    noise: Sequence[str] = (),
    prior: str | os.PathLike[str] | None = None,
    fixed: Mapping[str, float | None] | None = None,
    chains: int = 32,
    steps: int | None = None,
    seed: int = 1,
    threads: int = 0,
    resume: bool = False,
    force: bool = False,
    report: bool = False,
    progress: bool = False,
) -> dict[str, Any]:
    """Samples the posterior into a study and returns the document ``vitreo-uq/posterior/1``.

    `target` is an experiment (None: the replica), `out` the study (default ``vitreo-uq-out/<id>``), `chains` the walkers of an ensemble, `steps`
    the largest number of steps of a walker, `fixed` parameters held at a value in their unit (None frees one). `report` also writes ``report.html``.
    `read_study` then returns the draws.
    """
    options = _options(
        out=out, base=base, with_=_listed("effects", effects), noise=_listed("noise", noise), prior=prior, set_=fixed, chains=chains, steps=steps, seed=seed, threads=threads,
        resume=resume, force=force, no_report=not report,
    )
    return run("sample", *_words(target), *options, progress=progress)


def diagnose(
    study: Target,
    *,
    out: str | os.PathLike[str] | None = None,
    simulations: int | None = None,
    seed: int = 1,
    threads: int = 0,
    report: bool = False,
    progress: bool = False,
) -> dict[str, Any]:
    """Finds the physical effect that a model lacks and returns the document ``vitreo-uq/diagnosis/1``.

    `study` is a study or an experiment; `simulations` is the largest number of simulated searches that test a gain.
    """
    options = _options(out=out, simulations=simulations, seed=seed, threads=threads, no_report=not report)
    return run("diagnose", *_words(study), *options, progress=progress)
