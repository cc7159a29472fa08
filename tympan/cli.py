"""The ``tympan`` command. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from tympan.base.errors import WORKS_STILL, Failure, InputError, did_you_mean
from tympan.base.extras import needs
from tympan.base.process.folder import alone
from tympan.base.process.interruption import raise_again
from tympan.base.reader_process import ready_for
from tympan.base.system import out_of_memory
from tympan.base.toml_reader import one_of
from tympan.commands import COMMANDS, ELSEWHERE, FIRST, GROUPS, HEADINGS
from tympan.options import Command

#: Words that people write for an option, by the option's own name without dashes.
_SYNONYMS = {"weight": "mass", "load": "mass", "gram": "mass", "potential": "voltage",
             "volt": "voltage", "tension": "voltage", "folder": "output", "directory": "output",
             "jobs": "workers", "processes": "workers", "mesh": "refine"}

#: Types of values that argparse converts, in words.
_KINDS: dict[Any, str] = {int: "a whole number", float: "a number"}

#: Name of the program in its help.
_PROGRAM = "tympan"
#: Shells whose completion scripts shtab writes.
SHELLS = ("bash", "zsh", "tcsh")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; exit status 0 done, 1 failed with a message, 2 the input is wrong."""
    shown, warnings.showwarning = warnings.showwarning, _advise
    try:
        given = _by_help(sys.argv[1:] if arguments is None else list(arguments))
        options = build_parser(given).parse_args(given)
        with ready_for(_files(options)), alone(getattr(options, "output", None)):
            options.run(options)
    except (InputError, Failure) as error:
        raise_again()  # a signal may have caused it
        print("; ".join([f"tympan: {error}", *getattr(error, "__notes__", ())]), file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except Exception as error:
        short = out_of_memory(error)
        if short is None:
            raise
        print(f"tympan: {short}", file=sys.stderr)
        return 1
    finally:
        warnings.showwarning = shown
    return 0


def _advise(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
    """Print a warning of a former name in one line, others as Python does."""
    if issubclass(category, FutureWarning) and str(message).endswith(WORKS_STILL):
        print(f"tympan: {message}", file=sys.stderr)
    else:
        sys.stderr.write(warnings.formatwarning(message, category, *place[:2]))


def _files(options: argparse.Namespace) -> list[Path]:
    values = [value if isinstance(value, list) else [value] for value in vars(options).values()]
    return [file for file in chain(*values) if isinstance(file, Path)]


class _Asking(argparse.ArgumentParser):
    """Parser that suggests what was meant where a command, option or value is unknown."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        options = {str(choice): choice for choice in action.choices}
        if isinstance(action, argparse._SubParsersAction):
            former = {name for command in COMMANDS for name in command.formerly}
            names = [name for name in options if name not in former]
            if value in ELSEWHERE:
                raise InputError(f"unknown command: {ELSEWHERE[value]}", given=value)
            spelled = {name: repr(name) for name in names} | {
                word: repr(command.name) for command in COMMANDS
                if self.prog == _PROGRAM or command.name.startswith(f"{self.prog.split()[-1]} ")
                for word in (*command.also, *command.formerly) if word not in names}
            raise InputError(f"unknown command: {did_you_mean(value, spelled)}known are "
                             f"{', '.join(names)}", given=value)
        raise InputError(one_of(str(value), options), given=value, key=_name(action))

    def _get_values(self, action: argparse.Action, texts: list[str]) -> Any:
        empty = not isinstance(action, argparse._SubParsersAction) and any(
            not text.strip() for text in texts)
        if empty:
            raise InputError("is empty, as a variable that the shell does not know: give a value, "
                             "or leave it out", key=_name(action), given="")
        return super()._get_values(action, texts)

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        try:
            return super()._get_value(action, text)
        except argparse.ArgumentError:
            kind = _KINDS.get(action.type, "another value")
            raise InputError(f"must be {kind}", key=_name(action), given=text) from None

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, rest = super().parse_known_args(args, namespace)
        if rest:
            known = [name for action in self._actions for name in action.option_strings]
            spelled = {name.lstrip("-"): name for name in known}
            spelled |= {word: f"--{name}" for word, name in _SYNONYMS.items()
                        if f"--{name}" in known and word not in spelled}
            option = rest[0].partition("=")[0]
            hint = did_you_mean(option.lstrip("-"), spelled)
            raise InputError(f"unknown option: {hint}known are {', '.join(known)}"
                             if option.startswith("-") else
                             "is one argument too many; values with blanks need quotation marks",
                             given=option)
        return options, rest


def _name(action: argparse.Action) -> str:
    """Name an option by its names, another argument by its own."""
    return "/".join(action.option_strings) or str(action.metavar or action.dest)


def _by_help(given: list[str]) -> list[str]:
    """Translate ``tympan help``, and that of a page or a command."""
    if given[:1] != ["help"]:
        return given
    return [f"--help-{given[1]}"] if given[1:] in (["all"], ["loads"]) else [*given[1:], "--help"]


class _Parser(_Asking):
    """Parser that lists commands under headings: the first ones, or all."""

    def format_help(self) -> str:
        return self.listed(FIRST)

    def listed(self, headings: Mapping[str, Sequence[Command]]) -> str:
        """Write the help with these commands."""
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        for heading, commands in headings.items():
            formatter.start_section(heading)
            formatter.add_arguments([
                argparse.Action([], command.name, metavar=command.name,
                                help=command.summary.replace("%", "%%")) for command in commands])
            formatter.end_section()
        formatter.start_section("options")
        formatter.add_arguments([action for action in self._actions if action.option_strings])
        formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()


def build_parser(given: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Build the parser of the command line: all commands with their options.

    If the arguments ``given`` begin with the name of a command, it has that command only: to add
    all of them takes as long as to solve a film.
    """
    parser = _Parser(
        prog=_PROGRAM, description="Shape studies of dielectric-elastomer membrane actuators.",
        epilog='Quantities carry their unit: --mass "17.9 g" --voltage "3.5 kV". '
               "tympan COMMAND --help says more, with an example. tympan help loads explains "
               f"loads and rig, tympan help all lists all {len(COMMANDS)} commands.")
    parser.add_argument("--help-all", action=_HelpAll)
    parser.add_argument("--help-loads", action=_HelpLoads)
    parser.add_argument("--version", action=_Version)
    parser.add_argument("--print-completion", action=_Completion, choices=SHELLS)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND",
                                     parser_class=_Asking)
    groups = {"": commands}
    for command in [each for each in COMMANDS if each.begins(given)] or COMMANDS:
        group = command.name.rpartition(" ")[0]
        if group not in groups:
            words = GROUPS[group]
            groups[group] = commands.add_parser(
                group, help=words, description=f"{words[0].upper()}{words[1:]}.",
            ).add_subparsers(title="commands", required=True, metavar="COMMAND")
        command.add(groups[group])
    return parser


class _HelpAll(argparse.Action):
    """Action of ``--help-all``, which lists every command."""

    def __init__(self, option_strings: list[str], dest: str, **_: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="list all commands and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        assert isinstance(parser, _Parser)
        print(parser.listed(HEADINGS), end="")
        parser.exit()


class _HelpLoads(argparse.Action):
    """Action of ``--help-loads``, the page that questions about a film share."""

    def __init__(self, option_strings: list[str], dest: str, **_: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="explain loads and rig, and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from tympan.commands.loads import loads_page

        print(loads_page(COMMANDS), end="")
        parser.exit()


class _Version(argparse.Action):
    """Action of ``--version`` that reads package metadata only when it is needed."""

    def __init__(self, option_strings: list[str], dest: str, **_: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"tympan {version('tympan')}")
        parser.exit()


class _Completion(argparse.Action):
    """Action of ``--print-completion SHELL`` that imports shtab only when it is needed."""

    def __init__(self, option_strings: list[str], dest: str, **settings: Any) -> None:
        super().__init__(option_strings, dest, **settings, metavar="SHELL",
                         help="print a script that completes commands, options and files in "
                              f"{', '.join(SHELLS)}; then exit")

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 value: Any, option: str | None = None) -> None:
        needs("shtab", option or "completion")
        import shtab

        _complete_files(parser, shtab.FILE)
        print(shtab.complete(parser, shell=value))
        parser.exit()


def _complete_files(parser: argparse.ArgumentParser, files: object) -> None:
    """Mark every path argument for completion by files."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_files(command, files)
        elif action.type is Path:
            action.complete = files  # type: ignore[attr-defined]  # what shtab looks for
