"""Modules import in one direction only, keep the waist narrow, and stay short.

The order stands in reconros_zenoh/DESIGN.md, "The parts". Imports inside functions and under TYPE_CHECKING
count: they are dependencies as well.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

ROOT = Path(__file__).parents[1]
PACKAGES = ("reconros_zenoh", "board_daemon", "host_clients", "deploy")
MOST_LINES = 400

# From top to bottom: a module may import from its own line and from those above.
ORDER = (
    (
        "reconros_zenoh.errors",
        "reconros_zenoh.text_file",
        "reconros_zenoh.toml_file",
        "reconros_zenoh.yaml_node",
    ),
    ("reconros_zenoh.executor",),
    ("reconros_zenoh.gateway",),
    ("reconros_zenoh.clock",),
    ("reconros_zenoh.ros",),
    ("reconros_zenoh.transport",),
    ("reconros_zenoh.rmw",),
    ("reconros_zenoh.board",),
    ("reconros_zenoh.project",),
    ("reconros_zenoh.mapping",),
    ("reconros_zenoh.measure",),
    ("reconros_zenoh.applications",),
    ("board_daemon",),
    ("host_clients",),
    ("deploy",),
    ("reconros_zenoh.virtual_board",),
    ("reconros_zenoh.experiments",),
    ("reconros_zenoh.cli",),
    tuple(f"{package}.__main__" for package in PACKAGES),
)

# The waist: what lies between transport and the processes sees a Transport and nothing of its kinds.
BEHIND_THE_WAIST = tuple(
    f"reconros_zenoh.{package}"
    for package in ("rmw", "board", "project", "mapping", "measure", "applications")
)
MAY_IMPORT_ZENOH = ("reconros_zenoh.transport.zenoh", "reconros_zenoh.transport.zenoh_session")
MAY_IMPORT_ZENOH_TRANSPORT = (
    "board_daemon",
    "host_clients",
    "reconros_zenoh.experiments",
    "reconros_zenoh.cli",
)


@dataclass(frozen=True)
class Import:
    """One thing that a module imports, and where it says so."""

    place: str
    importer: str
    imported: str

    def __str__(self) -> str:
        return f"{self.place}: {self.importer} imports {self.imported}"


def lies_in(module: str, packages: tuple[str, ...]) -> bool:
    """Tell whether the module is one of these packages or lies in one of them."""
    return any(f"{module}.".startswith(f"{package}.") for package in packages)


def line_of_order(module: str) -> int | None:
    """Return the line of ORDER on which the module stands; the lowest that fits, for the entry points."""
    if module == "reconros_zenoh":
        return 0
    return max((line for line, packages in enumerate(ORDER) if lies_in(module, packages)), default=None)


def find_modules(root: Path) -> dict[str, Path]:
    """Return the files of all modules by dotted name."""
    modules = {}
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return modules


def find_imports(root: Path) -> Iterator[Import]:
    """Yield everything that the modules import."""
    modules = find_modules(root)
    for module, file in modules.items():
        package = module if file.name == "__init__.py" else module.rpartition(".")[0]
        for node, where in nodes(ast.parse(file.read_text(encoding="utf-8")), ""):
            for imported in imported_by(node, package.split("."), modules):
                yield Import(f"{file.relative_to(root)}:{node.lineno}{where}", module, imported)


def nodes(node: ast.AST, where: str) -> Iterator[tuple[ast.stmt | ast.expr, str]]:
    """Yield all statements and expressions from the node downwards, with a word on where they stand."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        where = " (in a function)"
    elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
        where = " (under TYPE_CHECKING)"
    if isinstance(node, ast.stmt | ast.expr):
        yield node, where
    for child in ast.iter_child_nodes(node):
        yield from nodes(child, where)


def imported_by(node: ast.AST, package: list[str], modules: Collection[str]) -> Iterator[str]:
    """Yield the dotted names of what this statement, or this call of import_module, imports."""
    match node:
        case ast.Import(names=names):
            yield from (alias.name for alias in names)
        case ast.ImportFrom(module=base, names=names, level=level):
            above = package[: len(package) - level + 1] if level else []
            start = ".".join([*above, *([base] if base else [])])
            # The name may be a module, or something that is defined in one.
            yield from (name if (name := f"{start}.{alias.name}") in modules else start for alias in names)
        case ast.Call(
            func=ast.Attribute(attr="import_module") | ast.Name(id="import_module" | "__import__"),
            args=[
                ast.Constant(value=str(name)) | ast.JoinedStr(values=[ast.Constant(value=str(name)), *_]),
                *_,
            ],
        ):
            yield name.rstrip(".")  # of `f"package.{module}"` as much as stands there


def wrong_direction(found: Import) -> bool:
    """Tell whether the import goes down in ORDER; what has no place there is wrong in itself."""
    if found.imported.split(".")[0] not in PACKAGES:
        return False
    if found.importer == "reconros_zenoh":  # hands out the public names, from wherever they are
        return False
    importer, imported = line_of_order(found.importer), line_of_order(found.imported)
    return importer is None or imported is None or imported > importer


def past_the_waist(found: Import) -> bool:
    """Tell whether the importer sees more of the transport than it may."""
    if lies_in(found.imported, ("zenoh",)):
        return not lies_in(found.importer, MAY_IMPORT_ZENOH)
    if found.imported == "reconros_zenoh.transport.zenoh":
        return not lies_in(found.importer, MAY_IMPORT_ZENOH_TRANSPORT)
    return (
        lies_in(found.importer, BEHIND_THE_WAIST)
        and lies_in(found.imported, ("reconros_zenoh.transport",))
        and found.imported != "reconros_zenoh.transport.base"
    )


@pytest.fixture(scope="module")
def imports() -> list[Import]:
    return list(find_imports(ROOT))


def test_every_module_has_a_place_in_the_order() -> None:
    modules = find_modules(ROOT).items()
    homeless = [f"{file.relative_to(ROOT)}:1" for module, file in modules if line_of_order(module) is None]
    assert not homeless, "no place in ORDER of this test:\n" + "\n".join(homeless)


def test_modules_import_only_from_their_own_package_and_from_those_above(imports: list[Import]) -> None:
    wrong = [str(found) for found in imports if wrong_direction(found)]
    assert not wrong, "imports against the direction:\n" + "\n".join(wrong)


def test_only_the_zenoh_transport_knows_zenoh_and_only_processes_know_the_zenoh_transport(
    imports: list[Import],
) -> None:
    wrong = [str(found) for found in imports if past_the_waist(found)]
    assert not wrong, "imports past the waist, transport.base:\n" + "\n".join(wrong)


def test_no_module_is_longer_than_one_concept() -> None:
    lengths = {
        file.relative_to(ROOT): len(file.read_text(encoding="utf-8").splitlines())
        for file in find_modules(ROOT).values()
    }
    long = [
        f"{file}:{MOST_LINES + 1}: {lines} lines" for file, lines in lengths.items() if lines > MOST_LINES
    ]
    assert not long, f"more than {MOST_LINES} lines:\n" + "\n".join(long)


def test_the_modules_of_all_packages_are_looked_at(imports: list[Import]) -> None:
    modules = find_modules(ROOT)
    for package in PACKAGES:
        assert package in modules
        assert sum(lies_in(module, (package,)) for module in modules) > 2
    assert {found.importer for found in imports if lies_in(found.imported, ("zenoh",))} == set(
        MAY_IMPORT_ZENOH
    )


BOARD = "reconros_zenoh/board/cpu.py"


@pytest.mark.parametrize(
    ("file", "source", "message"),
    [
        (BOARD, "import deploy.runner", "{}:1: reconros_zenoh.board.cpu imports deploy.runner"),
        (BOARD, "\nfrom deploy.runner import Runner", "{}:2: reconros_zenoh.board.cpu imports deploy.runner"),
        (
            BOARD,
            "from reconros_zenoh import cli, board",
            "{}:1: reconros_zenoh.board.cpu imports reconros_zenoh.cli",
        ),
        (
            BOARD,
            "from ..cli import main",
            "{}:1: reconros_zenoh.board.cpu imports reconros_zenoh.cli.main",
        ),
        (
            "reconros_zenoh/board/__init__.py",
            "from ..cli.main import main",
            "{}:1: reconros_zenoh.board imports reconros_zenoh.cli.main",
        ),
        (
            BOARD,
            "def f():\n    if x:\n        import deploy.runner",
            "{}:3 (in a function): reconros_zenoh.board.cpu imports deploy.runner",
        ),
        (
            BOARD,
            "if TYPE_CHECKING:\n    from deploy.runner import Runner",
            "{}:2 (under TYPE_CHECKING): reconros_zenoh.board.cpu imports deploy.runner",
        ),
        (
            BOARD,
            "importlib.import_module(f'reconros_zenoh.cli.{name}')",
            "{}:1: reconros_zenoh.board.cpu imports reconros_zenoh.cli",
        ),
        (
            BOARD,
            "from reconros_zenoh.new import thing",
            "{}:1: reconros_zenoh.board.cpu imports reconros_zenoh.new",
        ),
        (
            "board_daemon/daemon.py",
            "import board_daemon.__main__",
            "{}:1: board_daemon.daemon imports board_daemon.__main__",
        ),
        (BOARD, "import numpy, simpy\nfrom reconros_zenoh.board import osif", None),
        (BOARD, "from reconros_zenoh.rmw.node import Node\nfrom reconros_zenoh import errors", None),
        ("board_daemon/__main__.py", "from reconros_zenoh.cli.main import main", None),
    ],
)
def test_an_import_against_the_direction_is_named_with_its_file_and_line(
    tmp_path: Path, file: str, source: str, message: str | None
) -> None:
    for name in (file, "reconros_zenoh/cli/__init__.py", "reconros_zenoh/cli/main.py", "deploy/runner.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / file).write_text(source, encoding="utf-8")
    wrong = [str(found) for found in find_imports(tmp_path) if wrong_direction(found)]
    assert wrong == ([message.format(file)] if message else [])


@pytest.mark.parametrize(
    ("importer", "imported", "wrong"),
    [
        ("reconros_zenoh.transport.zenoh", "zenoh.shm", False),
        ("reconros_zenoh.transport.base", "zenoh", True),
        ("board_daemon.daemon", "zenoh", True),
        ("board_daemon.daemon", "zenoh_extras", False),
        ("board_daemon.daemon", "reconros_zenoh.transport.zenoh", False),
        ("reconros_zenoh.experiments.roundtrip_wall", "reconros_zenoh.transport.zenoh", False),
        ("reconros_zenoh.transport.simulated", "reconros_zenoh.transport.zenoh", True),
        ("deploy.runner", "reconros_zenoh.transport.zenoh", True),
        ("reconros_zenoh.board.control", "reconros_zenoh.transport.base", False),
        ("reconros_zenoh.board.control", "reconros_zenoh.transport.zenoh", True),
        ("reconros_zenoh.rmw.node", "reconros_zenoh.transport.simulated", True),
        ("reconros_zenoh.experiments.roundtrip_virtual", "reconros_zenoh.transport.simulated", False),
    ],
)
def test_the_waist_is_the_base_of_the_transport(importer: str, imported: str, wrong: bool) -> None:
    assert past_the_waist(Import("file:1", importer, imported)) is wrong
