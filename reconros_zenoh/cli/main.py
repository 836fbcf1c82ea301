"""The command `reconros`: its verbs and how they end."""

from __future__ import annotations

import importlib
import json
import logging
import signal
import sys
import warnings
from typing import Annotated, NoReturn

import typer

from reconros_zenoh.cli.printable import printable
from reconros_zenoh.cli.streams import drop_output, open_streams
from reconros_zenoh.clock.signals import EndingHandler, ending_signals
from reconros_zenoh.errors import ReconrosError, TransportError, UsageError

_LONGEST_LINE = 2000

_VERBS = {
    "demo": ("demo", "demo"),
    "experiment": ("experiment", "app"),
    "calibrate": ("calibrate", "calibrate"),
    "hist": ("hist", "hist"),
    "up": ("up", "up"),
    "down": ("up", "down"),
    "simulate": ("simulate", "simulate"),
    "router": ("daemons", "router"),
    "board": ("daemons", "board"),
    "client": ("daemons", "client"),
    "camera": ("desktop", "camera"),
    "viewer": ("desktop", "viewer"),
    "robot": ("desktop", "robot"),
    "status": ("daemons", "status"),
    "new": ("new", "new"),
    "check": ("check", "check"),
    "run": ("run", "run"),
    "compare": ("compare", "compare"),
    "gateway": ("gateway", "gateway"),
    "build": ("build", "build"),
    "map": ("map", "map_communication"),
}
"""Each verb with its module in this package and its name there, in the order of `reconros --help`."""


def main() -> None:
    """Run the command of this process's arguments and exit.

    Status 0: it did what was asked (router and board: until a signal came); 1: an experiment failed, or an
    answer was wrong or lost, or the output could not be written; 2: what was given cannot be used; 130:
    ended by Ctrl-C, SIGTERM or SIGHUP before its end. With --json an error is `{"error": ...}` on stdout,
    too.
    """
    open_streams()
    _log_to_stderr()
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # where its fonts are is nobody's concern
    warnings.filterwarnings("ignore", "Glyph .* missing from font")  # nor what they lack
    ending = EndingHandler()
    endings = ending_signals()
    for number in endings:
        signal.signal(number, ending)
    # A verb imports what it needs itself: the others' imports would double its start.
    given = sys.argv[1] if len(sys.argv) > 1 else ""
    try:
        try:
            verbs = [given] if given in _VERBS else list(_VERBS)
            sys.exit(_application(verbs)(prog_name="reconros", standalone_mode=False))
        except typer.TyperException as error:
            error.show()  # type: ignore[attr-defined] # those of the command line have it
            _end(error.format_message(), error.exit_code)
        except ReconrosError as error:
            _fail(str(error), 2 if isinstance(error, UsageError | TransportError) else 1)
        except OSError as error:
            if error.filename is None:  # the output
                raise
            _fail(f"{error.filename}: {error.strerror}. Check the path and its permissions.", 2)
        finally:
            sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:  # whoever read our output has had enough
        drop_output()
        sys.exit(1)
    except OSError as error:  # a full disk, for example
        drop_output()
        print(f"reconros: the output cannot be written: {error.strerror}", file=sys.stderr)
        sys.exit(1)
    finally:
        # Python gives its handlers back before it ends: a second signal would kill it and change the status.
        for number in endings:
            signal.signal(number, signal.SIG_IGN)


def _application(verbs: list[str]) -> typer.Typer:
    application = typer.Typer(
        name="reconros",
        help="ReconROS without the board: ROS 2 callbacks on emulated CPU+FPGA boards over Zenoh.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    application.callback()(_options)
    for verb in verbs:
        module, name = _VERBS[verb]
        command = getattr(importlib.import_module(f"reconros_zenoh.cli.{module}"), name)
        if isinstance(command, typer.Typer):
            application.add_typer(command, name=verb)
        else:
            application.command(verb)(command)
    return application


def _show_versions(is_wanted: bool) -> None:
    if is_wanted:
        from reconros_zenoh.experiments.provenance import versions

        for name, version in versions().items():
            print(name, version)
        raise typer.Exit


_Version = Annotated[
    bool,
    typer.Option(
        "--version", callback=_show_versions, is_eager=True, help="Show the versions of what is used here."
    ),
]


def _options(version: _Version = False) -> None:
    """Take what may stand before the verb; of `version` its own callback has seen to."""


def _fail(error: str, status: int) -> NoReturn:
    print(f"reconros: {printable(error)}", file=sys.stderr)
    _end(error, status)


def _end(error: str, status: int) -> NoReturn:
    """Exit after an error that stderr has heard of."""
    if "--json" in sys.argv:
        print(json.dumps({"error": error}), flush=True)
    sys.exit(status)


class Formatter(logging.Formatter):
    """One line for each record, and nothing in it that a terminal would obey."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 # as in the base
        """Return the line of a record, cut where it is too long."""
        when = f" at {record.elapsed_ms:.3f} ms" if hasattr(record, "elapsed_ms") else ""
        text = f"{record.levelname} {record.name}{when}: {record.message}"
        if len(text) > _LONGEST_LINE:
            text = f"{text[: _LONGEST_LINE // 2]} ... {text[-_LONGEST_LINE // 2 :]}"
        return printable(text, line_ends=False)


def _log_to_stderr() -> None:
    handler = logging.StreamHandler()
    handler.setFormatter(Formatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
