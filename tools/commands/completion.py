"""`gritd completion bash|zsh|fish`: what makes the shell complete commands, options and names.

The options are those that each command's `--help` names, so the script is never behind.
"""

from __future__ import annotations

import importlib
import io
import re
from argparse import RawDescriptionHelpFormatter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout, suppress

from gritd.estimator.effects import EFFECTS
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.commands.table import COMMANDS

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
HOW = {
    "bash": 'eval "$(gritd completion bash)"       # in ~/.bashrc',
    "zsh": 'eval "$(gritd completion zsh)"        # in ~/.zshrc, after compinit',
    "fish": "gritd completion fish | source       # in ~/.config/fish/config.fish",
}


def main(argv: Sequence[str]) -> int:
    """Print the script of a shell."""
    shells = "\n".join(f"  {line}" for line in HOW.values())

    parser = Parser(
        prog="gritd completion",
        description="Print what makes the shell complete gritd's commands and options.",
        epilog=f"to have it in every shell:\n{shells}",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", choices=HOW)

    print(SCRIPTS[parser.parse_args(argv).shell](words()))
    return DONE


def words() -> dict[str, list[str]]:
    """Command → what may follow it beside files: its options, and for some its names."""
    options = {name: options_of(module) for name, (module, _) in COMMANDS.items()}
    options["effects"] += list(EFFECTS)
    options["completion"] += list(HOW)
    return options


def options_of(module: str) -> list[str]:
    """The options that a command's help names."""
    help_text = io.StringIO()
    with suppress(SystemExit), redirect_stdout(help_text):  # so --help ends
        importlib.import_module(module).main(["--help"])
    return sorted({*OPTION.findall(help_text.getvalue())})


def bash(known: Mapping[str, Sequence[str]]) -> str:
    """Completion of bash; zsh takes it too, through bashcompinit."""
    return "\n".join(_bash(known))


def _bash(known: Mapping[str, Sequence[str]]) -> Iterator[str]:
    yield "_gritd() {"
    yield '    local word="${COMP_WORDS[COMP_CWORD]}" known'
    yield '    if [ "$COMP_CWORD" -eq 1 ]; then'
    yield f'        known="{" ".join(known)} --help --version"'
    yield "    else"
    yield '        case "${COMP_WORDS[1]}" in'

    for command, follows in known.items():
        yield f'        {command}) known="{" ".join(follows)}" ;;'
    yield "        esac"
    yield "    fi"

    yield '    COMPREPLY=($(compgen -W "$known" -- "$word"))'
    yield "}"
    yield "complete -o default -F _gritd gritd"


def zsh(known: Mapping[str, Sequence[str]]) -> str:
    """Completion of zsh by its emulation of bash's."""
    return "autoload -U +X bashcompinit && bashcompinit\n" + bash(known)


def fish(known: Mapping[str, Sequence[str]]) -> str:
    """Completion of fish."""
    lines = [f"complete -c gritd -n __fish_use_subcommand -f -a '{' '.join(known)}'"]
    for command, follows in known.items():
        lines.append(
            f"complete -c gritd -n '__fish_seen_subcommand_from {command}' -a '{' '.join(follows)}'"
        )
    return "\n".join(lines)


SCRIPTS = {"bash": bash, "zsh": zsh, "fish": fish}
