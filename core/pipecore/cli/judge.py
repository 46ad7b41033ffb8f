"""``pipecore judge``."""

import argparse
import csv
import tomllib
from collections.abc import Iterator
from pathlib import Path

from pipecore import io
from pipecore.cli.console import Console
from pipecore.cli.detect import check_output, deformation_lines
from pipecore.cli.parser import given_settings
from pipecore.editing import answer_for_deformation, answer_for_element, judge_again
from pipecore.errors import ReadError
from pipecore.report import load, summarise, write_report
from pipecore.settings import FlaggedPoints
from pipecore.types import Question, Result

ANSWERS = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
OF = "deformation", "element"


def run(args: argparse.Namespace, console: Console) -> None:
    """Load what was found, judge it anew, and write the report."""
    check_output(args.output, args.overwrite)
    result = judge_again(load(args.report, args.scan, progress=console), given_settings(args))
    if args.answers is not None:
        result = with_answers(result, args.answers)
    segments = args.report / "segments.laz"
    if not segments.is_file():
        console.note("Without “segments.laz” there is no page and no segmented cloud.")
        write_report(args.output, None, result, overwrite=args.overwrite, progress=console)
    else:
        cloud = io.read([segments], flagged_points=FlaggedPoints.KEEP, progress=console)
        console.warn(
            write_report(
                args.output,
                cloud,
                result,
                segments=segments,
                overwrite=args.overwrite,
                progress=console,
            )
        )
    console.say(f"{summarise(result)}.")
    for line in deformation_lines(result):
        console.say(line)


def with_answers(result: Result, path: Path) -> Result:
    """Return a result with the answers of a file.

    Parameters
    ----------
    result : Result
    path : Path
        CSV with a column ``deformation_id`` or ``element_id`` (or both, one filled in a row)
        and columns named by questions with yes, no or nothing; or TOML with tables such as
        ``[deformation.3]`` and ``[element.7]``.

    Returns
    -------
    Result

    Raises
    ------
    ReadError
        If the file cannot be read, or names what is not there.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        rows = list(_of_toml(text) if path.suffix.lower() == ".toml" else _of_csv(text))
    except (OSError, ValueError) as error:
        raise ReadError(
            "Cannot read the answers in “{path}”: {error}.", path=path, error=error
        ) from error
    for of, number, question, answer in rows:
        change = answer_for_deformation if of == "deformation" else answer_for_element
        result = change(result, number, question, answer)
    return result


Row = tuple[str, int, Question, bool]


def _of_toml(text: str) -> Iterator[Row]:
    for of, tables in tomllib.loads(text).items():
        if of not in OF or not isinstance(tables, dict):
            raise ValueError(f"“{of}” is neither deformation nor element")
        for number, answers in tables.items():
            if not isinstance(answers, dict):
                raise ValueError(f"“{of}.{number}” is not a table of answers")
            for name, answer in answers.items():
                yield of, int(number), Question(name), _answer(str(answer))


def _of_csv(text: str) -> Iterator[Row]:
    table = csv.DictReader(text.splitlines())
    names = [name for name in table.fieldnames or () if name.removesuffix("_id") not in OF]
    if len(names) == len(table.fieldnames or ()):
        raise ValueError("it has no column deformation_id or element_id")
    for row in table:
        given = [(of, row.get(f"{of}_id") or "") for of in OF]
        filled = [(of, number) for of, number in given if number.strip()]
        if len(filled) != 1:
            raise ValueError(f"line {table.line_num} is not of one deformation or element")
        for name in names:
            if (row[name] or "").strip():
                yield filled[0][0], int(filled[0][1]), Question(name.strip()), _answer(row[name])


def _answer(text: str) -> bool:
    answer = ANSWERS.get(text.strip().lower())
    if answer is None:
        raise ValueError(f"“{text}” is neither yes nor no")
    return answer
