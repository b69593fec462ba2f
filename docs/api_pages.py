"""Write the pages of the API reference: one per package, from the package's list of public names."""

import inspect
from importlib import import_module
from pathlib import Path

PACKAGES = {
    "blobtree": "Models",
    "blobtree.custom": "Kinds of nodes from single functions",
    "blobtree.tracing": "Rays",
    "blobtree.foreign": "Trees of other programs",
    "blobtree.sampling": "Grids of fields and distances",
    "blobtree.errors": "Exceptions of models",
    "decals": "Decals, scenes and pictures",
    "decals.scattering": "Scattering in steps",
    "decals.surfaces": "Surfaces",
    "decals.field": "The field of decals",
    "decals.index": "The index of decals",
    "decals.scenes": "Scenes and cameras",
    "decals.rendering": "Rendering in steps",
    "decals.hosts": "Decals in other programs",
    "decals.pages": "Pages",
    "decals.editing": "Editing without a window",
    "decals.window": "Editing windows",
    "decals.vtk": "Decals in pyvista and VTK",
    "decals.images": "Images",
    "decals.errors": "Exceptions",
}
"""Packages with a public API, and the titles of their pages."""

GROUPS = ("Functions", "Classes", "Exceptions", "Values")


def group_of(value: object) -> str:
    """Return the heading below which a public name stands."""
    if inspect.isclass(value):
        return "Exceptions" if issubclass(value, BaseException) else "Classes"
    return "Functions" if inspect.isroutine(value) else "Values"


def page(package: str, title: str, documented: dict[int, str]) -> str:
    """Return the page of a package; empty if it exports nothing.

    Parameters
    ----------
    package, title
        Import name and heading.
    documented
        Names under which objects stand on earlier pages, by `id`; objects of this page are added.
    """
    module = import_module(package)
    names: dict[str, list[str]] = {group: [] for group in GROUPS}
    elsewhere: list[str] = []
    exported = {name: getattr(module, name) for name in sorted(getattr(module, "__all__", ()))}
    # Former names of a class come last: autodoc has no page of them.
    for name, value in sorted(exported.items(), key=lambda item: getattr(item[1], "__name__", "") != item[0]):
        if inspect.ismodule(value):
            continue
        group = group_of(value)
        if group != "Values" and id(value) in documented:
            elsewhere.append(documented[id(value)])
            continue
        documented[id(value)] = f"{package}.{name}"
        names[group].append(name)
    if not any(names.values()):
        return ""
    heading = f"{title}: {package}"
    lines = [heading, "=" * len(heading), "", f".. currentmodule:: {package}", ""]
    for group, members in names.items():
        if not members:
            continue
        lines += [group, "-" * len(group), ""]
        if group == "Values":
            for name in members:
                text = " ".join(repr(getattr(module, name)).split())
                lines += [f".. py:data:: {name}", f"   :value: {text}", ""]
        else:
            lines += [
                ".. autosummary::",
                "   :toctree: generated",
                "",
                *(f"   {name}" for name in members),
                "",
            ]
    if elsewhere:
        lines += ["Also exported here: " + ", ".join(f":obj:`{name}`" for name in elsewhere) + ".", ""]
    return "\n".join(lines)


def write(folder: Path) -> None:
    """Write all pages into a folder and remove obsolete ones; unchanged files stay untouched."""
    folder.mkdir(parents=True, exist_ok=True)
    documented: dict[int, str] = {}
    pages = {package: page(package, title, documented) for package, title in PACKAGES.items()}
    for stub in (folder / "generated").glob("*.rst"):
        if stub.stem not in documented.values():
            stub.unlink()
    existing = [package for package, text in pages.items() if text]
    index = ["API reference", "=============", "", ".. toctree::", "   :maxdepth: 1", ""]
    pages["index"] = "\n".join([*index, *(f"   {package}" for package in existing), ""])
    for name, text in pages.items():
        path = folder / f"{name}.rst"
        if not text:
            path.unlink(missing_ok=True)
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
