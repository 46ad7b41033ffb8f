"""The arguments; those of the settings are made from the settings themselves."""

import argparse
import dataclasses
import inspect
from collections.abc import Collection, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, get_type_hints

import pipecore
from pipecore.settings import JUDGING_KEYS, FieldSpec, Settings, choices_of, iterate_fields

READING = "input.length_unit", "input.flagged_points", "input.stations", "input.columns"
"""Settings of every command that reads scans."""
SHORT = "input.length_unit", "input.columns"
"""Settings whose flags may be given without their group."""
SETTING = "setting:"
"""Prefix of the names under which the parser keeps settings, before their dotted keys."""

DETECT_EPILOG = """\
examples:
  pipecore detect scan.laz -o report
  pipecore detect east.e57 west.e57 -o report --stacks-width-mm 15
  pipecore detect scan.laz -o report --settings report-before/settings.toml

A value that begins with a minus sign takes “=”: --stacks-directions=-1,0,0
Exit code 0: done; 1: input or settings wrong; 2: usage; 130: cancelled."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="pipecore",
        description="Find pipes in laser scans, measure them, and find where they are deformed.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"pipecore {pipecore.__version__}")
    parser.set_defaults(shows_stages=True)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_detect(commands)
    _add_judge(commands)
    _add_simulate(commands)
    _add_info(commands)
    _add_convert(commands)
    return parser


def given_settings(args: argparse.Namespace) -> dict[str, str]:
    """Return the settings that were given as flags: text by dotted key."""
    values: Mapping[str, Any] = vars(args)
    return {
        name.removeprefix(SETTING): value
        for name, value in values.items()
        if name.startswith(SETTING) and value is not None
    }


def _add_detect(commands: Any) -> None:
    parser = commands.add_parser(
        "detect",
        usage="pipecore detect INPUT... -o DIR [options] [--SETTING VALUE ...]",
        help="find and measure the pipes in scans and write a report",
        description="Find and measure the pipes in scans and write a report.",
        epilog=DETECT_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    _add_inputs(parser)
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder of the report"
    )
    parser.add_argument(
        "--settings", type=Path, metavar="FILE.toml", help="settings; flags win over them"
    )
    _add_box(parser)
    parser.add_argument(
        "--overwrite", action="store_true", help="replace a report that is already in DIR"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument(
        "--threads", type=_count, metavar="N", help="processor threads to use (default: all)"
    )
    _add_settings(parser)


def _add_judge(commands: Any) -> None:
    parser = commands.add_parser(
        "judge",
        help="judge what was found anew: by another rule, with other sizes, with answers",
        description="Judge the deformations of a report or a project anew, without a detection, "
        "and write the report again. Settings that are not given stay as they were.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "report", type=Path, metavar="DIR", help="folder of a report, or a project (.pipegui)"
    )
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder of the new report"
    )
    parser.add_argument("--scan", metavar="NAME", help="which scan of a project")
    parser.add_argument(
        "--answers",
        type=Path,
        metavar="FILE",
        help="answers to what the rules ask, as CSV or TOML: of a deformation_id or an element_id, "
        "yes or no by question",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace a report that is already there"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    _add_settings(parser, JUDGING_KEYS)


def _add_simulate(commands: Any) -> None:
    parser = commands.add_parser(
        "simulate",
        help="simulate a scan of a described scene",
        description="Simulate a scan of a scene; what is true of it is written beside it.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "scene",
        metavar="SCENE",
        help="a scene file (.toml) or the name of a scene that comes along",
    )
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE.laz", help="the scan"
    )
    parser.add_argument(
        "--seed", type=_natural, metavar="N", help="seed of the scan's errors, for another scan"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def _add_info(commands: Any) -> None:
    parser = commands.add_parser(
        "info",
        help="say what is in a scan file",
        description="Say what is in a scan file: points, extent, spacing, fields, CRS.",
        allow_abbrev=False,
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.set_defaults(quiet=False, shows_stages=False)
    _add_settings(parser, READING)


def _add_convert(commands: Any) -> None:
    parser = commands.add_parser(
        "convert",
        help="write scans as LAS, LAZ, PLY or E57, with all that they hold",
        description="Write scans, as one cloud, as LAS, LAZ, PLY or E57: coordinates to the last "
        "digit, stations, reference system and all values of each point.",
        allow_abbrev=False,
    )
    _add_inputs(parser)
    parser.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE", help="its ending is the format"
    )
    _add_box(parser)
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    _add_settings(parser, READING)


def _add_inputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "inputs",
        nargs="+",
        type=Path,
        metavar="INPUT",
        help="scan (LAS, LAZ, E57, PTX, PLY, PCD, PTS, XYZ, CSV); several are taken as one cloud",
    )


def _add_box(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--box",
        nargs=6,
        type=float,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
        help="only points between these two corners, in the file's coordinates; of COPC files "
        "the rest is not even read",
    )


def _add_settings(parser: argparse.ArgumentParser, keys: Collection[str] | None = None) -> None:
    """Add flags for the settings with these keys, or for all."""
    groups: dict[str, Any] = {}
    kinds = get_type_hints(Settings)
    for field in dataclasses.fields(Settings):
        if keys is not None and not any(key.startswith(f"{field.name}.") for key in keys):
            continue
        title = (inspect.getdoc(kinds[field.name]) or field.name).splitlines()[0].rstrip(".")
        groups[field.name] = parser.add_argument_group(f"settings: {title[0].lower()}{title[1:]}")
    for key, spec in iterate_fields():
        if keys is not None and key not in keys:
            continue
        groups[spec.group].add_argument(
            f"--{spec.group}-{spec.name}".replace("_", "-"),
            *([f"--{spec.name}".replace("_", "-")] if key in SHORT else []),
            dest=SETTING + key,
            metavar=_metavar(spec),
            help=_help(spec),
        )


def _metavar(spec: FieldSpec) -> str:
    if spec.unit:
        return {"°": "DEG", "%": "PCT"}.get(spec.unit, spec.unit.upper())
    return "NUMBER" if spec.kind is float else "VALUE"


def _help(spec: FieldSpec) -> str:
    unit = f" {spec.unit}" if spec.unit else ""
    notes = []
    if isinstance(spec.kind, type) and issubclass(spec.kind, StrEnum):
        notes.append("one of " + ", ".join(spec.kind))
    if several := choices_of(spec.kind):
        notes.append("of " + ", ".join(several))
    if spec.minimum is not None and spec.maximum is not None:
        notes.append(f"{spec.minimum:g} to {spec.maximum:g}{unit}")
    elif spec.minimum is not None:
        notes.append(f"at least {spec.minimum:g}{unit}")
    elif spec.maximum is not None:
        notes.append(f"at most {spec.maximum:g}{unit}")
    if spec.zero_means:
        notes.append(f"0: {spec.zero_means}")
    if isinstance(spec.default, float):
        notes.append(f"default {round(spec.default, 3):g}")
    elif spec.default:
        default = spec.default if isinstance(spec.default, str) else ", ".join(spec.default)
        notes.append(f"default {default}")
    text = f"{spec.help} ({'; '.join(notes)})" if notes else spec.help
    return text.replace("%", "%%")


def _natural(text: str) -> int:
    number = int(text)
    if number < 0:
        raise argparse.ArgumentTypeError("must not be negative")
    return number


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number
