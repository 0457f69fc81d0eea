"""Adapters: record the solves of planners in scripts that are not changed, for `brrt record`."""

from brrt.recorder.adapters.adapter import Adapter
from brrt.recorder.adapters.classes import when_defined
from brrt.recorder.adapters.imports import when_imported
from brrt.recorder.adapters.solves import Solves
from brrt.registry import Registry

ADAPTERS: Registry[type[Adapter]] = Registry(
    {
        "rrt-classes": "brrt.recorder.adapters.rrt_classes:RRTClasses",
        "ompl": "brrt.ompl.adapter:OmplAdapter",
    },
    group="brrt.adapters",
    base="brrt.recorder.adapters.adapter:Adapter",
)

__all__ = ["ADAPTERS", "Adapter", "Solves", "when_defined", "when_imported"]
