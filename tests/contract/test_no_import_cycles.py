"""No module imports itself by way of others, imports for types and within functions counted."""

from collections.abc import Iterator

import grimp


def test_no_modules_import_each_other() -> None:
    graph = grimp.build_graph("cosmic", exclude_type_checking_imports=False, cache_dir=None)
    names = sorted(graph.modules)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in names}
    cycles = [" - ".join(sorted(ring)) for ring in strongly_connected(imports) if len(ring) > 1]
    assert cycles == []


def test_a_cycle_would_be_found() -> None:
    imports = {"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": set()}
    assert [ring for ring in strongly_connected(imports) if len(ring) > 1] == [{"a", "b", "c"}]


def strongly_connected(imports: dict[str, set[str]]) -> Iterator[set[str]]:
    """Give the groups in which each module reaches each other (Kosaraju's two passes)."""
    importers: dict[str, set[str]] = {name: set() for name in imports}
    for name, imported in imports.items():
        for each in imported & imports.keys():
            importers[each].add(name)
    order: list[str] = []
    seen: set[str] = set()
    for name in imports:
        finish(name, imports, seen, order)
    seen.clear()
    for name in reversed(order):
        group: list[str] = []
        finish(name, importers, seen, group)
        if group:
            yield set(group)


def finish(name: str, edges: dict[str, set[str]], seen: set[str], order: list[str]) -> None:
    """Append what is reached from `name` and was not `seen`, each after all that it reaches."""
    path = [(name, iter(sorted(edges[name])))] if name not in seen else []
    seen.add(name)
    while path:
        node, following = path[-1]
        each = next((one for one in following if one in edges and one not in seen), None)
        if each is None:
            order.append(node)
            path.pop()
        else:
            seen.add(each)
            path.append((each, iter(sorted(edges[each]))))
