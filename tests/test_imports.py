"""The map of the product: no circles between files or folders, no class name twice, nothing from the benchmarks.

Imports inside functions and those for type checkers alone count as well.
"""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("motiondeck", "motiondeck_base", "controller", "sim", "hardware")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_names(tree, module, is_package):
    """Absolute names of all that a file imports, each as far as the statement spells it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                up = module.split(".")[: len(module.split(".")) - node.level + is_package]
                base = ".".join([*up, base] if base else up)
            yield from (f"{base}.{alias.name}" for alias in node.names)


def imports_of(trees):
    """The names that each module imports."""
    return {
        module_of(path): list(imported_names(tree, module_of(path), path.stem == "__init__"))
        for path, tree in trees.items()
    }


def import_graph(imports):
    """The modules that each module imports; a name that is no module counts for the module that holds it."""
    graph, known = defaultdict(set), imports.keys()
    for module, names in imports.items():
        for name in names:
            target = name if name in known else name.rpartition(".")[0]
            if target in known and target != module:
                graph[module].add(target)
    return graph


def circles(graph):
    """The groups of nodes that reach each other (strongly connected components of two or more), sorted."""
    reach = {}
    for start in graph:
        seen, waiting = set(), [start]
        while waiting:
            for node in graph.get(waiting.pop(), ()):
                if node not in seen:
                    seen.add(node)
                    waiting.append(node)
        reach[start] = seen
    groups = {tuple(sorted({n for n in reach[s] if s in reach.get(n, ())} | {s})) for s in graph if s in reach[s]}
    return sorted(groups)


def folder_graph(graph, folder_of):
    folders = defaultdict(set)
    for module, targets in graph.items():
        own = folder_of[module]
        folders[own] |= {folder_of[target] for target in targets} - {own}
    return folders


@pytest.fixture(scope="module")
def trees():
    """Not read when tests are collected, which every worker does."""
    return {path: ast.parse(path.read_text()) for path in FILES}


@pytest.fixture(scope="module")
def imports(trees):
    return imports_of(trees)


@pytest.fixture(scope="module")
def graph(imports):
    return import_graph(imports)


def test_circles_are_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [("a", "b", "c")]
    assert circles({"a": {"b"}, "b": set()}) == []
    late = "def f():\n    from sim.b import g\n"
    hinted = "if TYPE_CHECKING:\n    import sim.a\n"
    trees = {ROOT / "sim" / "a.py": ast.parse(late), ROOT / "sim" / "b.py": ast.parse(hinted)}
    assert circles(import_graph(imports_of(trees))) == [("sim.a", "sim.b")]


def test_no_files_import_each_other_in_a_circle(graph):
    assert circles(graph) == []


def test_no_folders_import_each_other_in_a_circle(graph):
    folder_of = {module_of(path): str(path.parent.relative_to(ROOT)) for path in FILES}
    assert circles(folder_graph(graph, folder_of)) == []


def test_no_product_file_imports_the_benchmarks(imports):
    for module, names in imports.items():
        found = [name for name in names if name.partition(".")[0] in ("benchmarks", "tests")]
        assert not found, f"{module} imports {found}"


def test_no_class_name_stands_twice_below_the_front_door(trees):
    """What `motiondeck` makes public may bear the name of what it wraps."""
    places = defaultdict(list)
    for path, tree in trees.items():
        if path.parent == ROOT / "motiondeck":
            continue
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(str(path.relative_to(ROOT)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}
