"""The graph of imports between the project's own modules, and its cycles."""

import ast
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {"blobtree": "blobtree", "decals": "decals", "apps": "decals.apps", "shaders": "decals.shaders"}
"""The folder of each package, and its name in an installed copy."""

Graph = Mapping[str, set[str]]


@cache
def modules() -> dict[str, Path]:
    """Return the file of every module, by the module's full name."""
    names = {}
    for folder, package in FOLDERS.items():
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            names[".".join([package, *(part for part in parts if part != "__init__")])] = path
    return names


@cache
def imported_names(module: str, path: Path) -> list[str]:
    """Return the full name of each import in a file: inside functions and for type checking too."""
    return [name for _, name in _statements(module, path)]


@cache
def names_at_run_time(module: str, path: Path) -> list[str]:
    """Return what a file imports without a statement that names it.

    That are the public names of a package whose stub `blobtree.lazy.attach_stub` reads, and what
    ``import_module`` imports: a text that names a module, or begins with ``{package.__name__}.``.
    """
    if "= attach_stub(" in path.read_text(encoding="utf-8"):
        return imported_names(module, path.with_suffix(".pyi"))
    if path.name == "__init__.py":
        return []
    packages = dict(_statements(module, path))
    if not any(name.startswith("importlib") for name in packages.values()):
        return []
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Constant(value=str(name)) if "." in name and name in modules():
                names.append(name)
            case ast.FormattedValue(value=ast.Attribute(value=ast.Name(id=alias), attr="__name__")):
                names += [name for name in modules() if name.rpartition(".")[0] == packages.get(alias)]
    return names


def _statements(module: str, path: Path) -> list[tuple[str, str]]:
    """Return the import statements of a file: local names and full names.

    A star in a stub stands for what the stub of that module imports.
    """
    names: list[tuple[str, str]] = []
    package = module if path.stem == "__init__" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [(alias.asname or alias.name, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")
            prefix = [".".join(base[: len(base) + 1 - node.level])] if node.level else []
            source = ".".join([*prefix, *([node.module] if node.module else [])])
            stub = path.with_name(f"{node.module}.pyi")
            if path.suffix == ".pyi" and node.names[0].name == "*":
                names += [(source, source), *_statements(source, stub)]
            else:
                names += [(alias.asname or alias.name, f"{source}.{alias.name}") for alias in node.names]
    return names


def module_graph(*, run_time: bool = True) -> Graph:
    """Return the modules that each module imports; without `run_time`, those of its statements alone."""
    known = modules()
    graph: dict[str, set[str]] = {name: set() for name in known}
    for name, path in known.items():
        names = imported_names(name, path) + (names_at_run_time(name, path) if run_time else [])
        for imported in names:
            # The last part of a name is either a module or a value in one.
            target = imported if imported in known else imported.rpartition(".")[0]
            if target in known and target != name:
                graph[name].add(target)
    return graph


def package_graph() -> Graph:
    """Return the packages that each package imports by statements.

    A module that lies directly in ``blobtree`` or ``decals`` counts as a package of its own.
    """
    known = modules()

    def unit(name: str) -> str:
        depth = 3 if name.startswith("decals.apps.") else 2
        return (
            ".".join(name.split(".")[:depth]) if name.count(".") or name not in known else f"{name}.__init__"
        )

    graph: dict[str, set[str]] = {}
    for name, targets in module_graph(run_time=False).items():
        graph.setdefault(unit(name), set()).update(map(unit, targets))
    return {name: targets - {name} for name, targets in graph.items()}


def cycles(graph: Graph) -> list[set[str]]:
    """Return the strongly connected components that hold more than one node."""

    def reachable(start: str, edges: Mapping[str, Iterable[str]]) -> set[str]:
        seen: set[str] = set()
        stack = [start]
        while stack:
            for target in edges.get(stack.pop(), ()):
                if target not in seen:
                    seen.add(target)
                    stack.append(target)
        return seen

    forward = {name: reachable(name, graph) for name in graph}
    components: list[set[str]] = []
    for name in sorted(graph):
        if name in forward[name] and not any(name in component for component in components):
            components.append({other for other in forward[name] if name in forward.get(other, ())})
    return components
