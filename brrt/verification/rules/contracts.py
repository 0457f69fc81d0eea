"""The rule about the contract that a recording states."""

from importlib.metadata import version

from brrt.scenario.contracts import contract_differences
from brrt.scenario.manifest import Manifest
from brrt.verification.context import Context
from brrt.verification.result import RuleResult


def contract(context: Context, result: RuleResult) -> None:
    """A stated contract is that of the registered planner of the same version of brrt."""
    differences = contract_differences(context.manifest, context.world)
    if differences is None or not same_version(context.manifest):
        return
    result.one(None, differences[0] if differences else None)
    for difference in differences[1:]:
        result.fault(None, difference)


def same_version(manifest: Manifest) -> bool:
    """Whether this version of brrt made the recording; others may have other defaults."""
    return manifest.made_by.get("brrt") == version("brrt")


RULES = (contract,)
"""All rules of this file; see `brrt.verification`."""
