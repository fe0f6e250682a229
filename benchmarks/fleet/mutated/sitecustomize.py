"""Breaks modules of every Python process that finds this on its path: MUTATED = JSON of [module, text, instead]."""

import importlib.abc
import importlib.machinery
import json
import os
import sys

_CHANGES = json.loads(os.environ["MUTATED"])


class _Mutated(importlib.machinery.SourceFileLoader):
    def get_code(self, fullname):
        source = self.get_source(fullname) or ""
        for module, text, instead in _CHANGES:
            if module == fullname:
                if text not in source:
                    sys.exit(f"{module} no longer has '{text}'")
                source = source.replace(text, instead)
        return compile(source, self.path, "exec")


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, fullname, path=None, target=None):
        if not any(module == fullname for module, _, _ in _CHANGES):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        if spec is not None and spec.origin is not None:
            spec.loader = _Mutated(fullname, spec.origin)
        return spec


sys.meta_path.insert(0, _Finder())
