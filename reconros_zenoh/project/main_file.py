"""The Python of a project: main.py and the modules beside it."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import traceback
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from reconros_zenoh.errors import FileError, ReconrosError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    from reconros_zenoh.project.application import Application


def load_main(folder: Path, name: str) -> Callable[[Application], None]:
    """Return the function `main` of main.py; `FileError` with the line for what goes wrong in the file."""
    path = folder / "main.py"
    if not path.is_file():
        raise FileError(path, None, "is missing.", "Write a main.py with a function `main(app)`.")
    spec = importlib.util.spec_from_file_location(f"reconros_project_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with running_project(folder):
        spec.loader.exec_module(module)
    main: Callable[[Application], None] | None = getattr(module, "main", None)
    if not callable(main):
        raise FileError(path, None, "has no function `main`.", "Write `def main(app): ...`.")
    return main


@contextmanager
def running_project(folder: Path) -> Iterator[None]:
    """Let code of a project run: its modules can be imported, its mistakes are a `FileError` with their line.

    The modules are forgotten afterwards, because the next project may have others of the same names.
    """
    root = folder.absolute()
    before = set(sys.modules)
    importlib.invalidate_caches()
    sys.path.insert(0, str(root))
    try:
        yield
    except FileError:
        raise
    except UsageError as error:
        path, line = _place(error, root)
        raise FileError(folder / path, line, str(error)) from error
    except ReconrosError:
        raise
    except (Exception, SystemExit) as error:
        path, line = _place(error, root)
        raise FileError(folder / path, line, f"{type(error).__name__}: {error}.") from error
    finally:
        sys.path.remove(str(root))
        own = {
            name
            for name in set(sys.modules) - before
            if "." not in name and _lies_in(sys.modules[name], root)
        }
        for name in set(sys.modules) - before:
            if name.split(".")[0] in own:
                del sys.modules[name]


def _lies_in(module: ModuleType, root: Path) -> bool:
    """Tell whether a top-level module stands in the folder itself, not in an environment below it."""
    file = getattr(module, "__file__", None)
    if file is None:  # a package without __init__.py
        return any(Path(place).parent == root for place in getattr(module, "__path__", ()))
    path = Path(file)
    return root in {path.parent, path.parent.parent if path.name == "__init__.py" else None}


def _place(error: BaseException, root: Path) -> tuple[Path, int | None]:
    """Return the file of the project, relative to it, and the line in which the error was raised."""
    places = [(Path(frame.filename), frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError) and error.filename:
        places.append((Path(error.filename), error.lineno))
    own = [
        (path.relative_to(root), line)
        for path, line in places
        if path.is_relative_to(root) and "site-packages" not in path.parts
    ]
    return own[-1] if own else (Path("main.py"), None)
