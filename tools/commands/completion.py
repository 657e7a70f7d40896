"""`gritd completion bash|zsh|fish`: what makes the shell complete commands, options and names.

The options are those of each command's parser, so the script is never behind.
"""

from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter, _SubParsersAction
from collections.abc import Iterator, Mapping, Sequence

from gritd.estimator.effects import EFFECTS
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.commands.table import COMMANDS, parser_of

HOW = {
    "bash": 'eval "$(gritd completion bash)"       # in ~/.bashrc',
    "zsh": 'eval "$(gritd completion zsh)"        # in ~/.zshrc, after compinit',
    "fish": "gritd completion fish | source       # in ~/.config/fish/config.fish",
}


def main(argv: Sequence[str]) -> int:
    """Print the script of a shell."""
    print(SCRIPTS[build_parser().parse_args(argv).shell](words()))
    return DONE


def words() -> dict[str, list[str]]:
    """Command → what may follow it besides files: its options, and for some its names."""
    options = {name: sorted(options_of(parser_of(name))) for name in COMMANDS}
    options["effects"] += list(EFFECTS)
    options["completion"] += list(HOW)
    return options


def options_of(parser: ArgumentParser) -> set[str]:
    """The long options of a command, and of its subcommands."""
    actions = parser._actions  # argparse has no public way
    own = {word for action in actions for word in action.option_strings if word.startswith("--")}
    below = [a.choices.values() for a in actions if isinstance(a, _SubParsersAction)]
    return own.union(*(options_of(each) for parsers in below for each in parsers))


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


def build_parser() -> Parser:
    shells = "\n".join(f"  {line}" for line in HOW.values())

    parser = Parser(
        prog="gritd completion",
        description="Print what makes the shell complete gritd's commands and options.",
        epilog=f"to have it in every shell:\n{shells}",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", choices=HOW)

    return parser
